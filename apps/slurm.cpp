#include "apps/slurm.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "apps/progress.h"
#include "base/file_bytes.h"
#include "base/program_beside.h"
#include "base/shard.h"
#include "base/stop.h"
#include "base/write_file.h"
#include "rehearsal/runner/child_process.h"

namespace narpa::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSlurm = "slurm";

std::string in_slurm(const std::string& folder, const char* name) {
    return (fs::path(folder) / "slurm" / name).string();
}

std::string quoted(std::vector<std::string> line) {
    rehearsal::ChildProcess::Command command;
    command.line = std::move(line);
    return rehearsal::ChildProcess::shell_line(command);
}

std::string narpa_line(const std::vector<std::string>& arguments) {
    std::vector<std::string> line{(program_folder() / "narpa").string()};
    line.insert(line.end(), arguments.begin(), arguments.end());
    return quoted(std::move(line));
}

struct ShellResult {
    int status = 0;
    std::string text;  ///< standard output and error, without the last line break
};

ShellResult run_by_shell(const std::string& line) {
    ShellResult result;
    FILE* const pipe = ::popen((line + " 2>&1").c_str(), "re");
    if (pipe == nullptr) return {127, "cannot start sh"};
    std::array<char, 4096> part;
    for (std::size_t n = 0; (n = std::fread(part.data(), 1, part.size(), pipe)) > 0;)
        result.text.append(part.data(), n);
    result.status = ::pclose(pipe);
    while (result.text.ends_with('\n')) result.text.pop_back();
    return result;
}

bool is_on_path(const char* program) {
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path != nullptr ? path : "");
    for (std::string folder; std::getline(folders, folder, ':');)
        if (::access((fs::path(folder) / program).c_str(), X_OK) == 0) return true;
    return false;
}

/// "1-3,7": numbers of the shards, from 1.
std::string array_indices(const std::vector<Shard>& shards) {
    std::string text;
    for (std::size_t first = 0, last = 0; first < shards.size(); first = last + 1) {
        last = first;
        while (last + 1 < shards.size() && shards[last + 1].index == shards[last].index + 1) ++last;
        text += (text.empty() ? "" : ",") + std::to_string(shards[first].index + 1);
        if (last > first) text += "-" + std::to_string(shards[last].index + 1);
    }
    return text;
}

/// A file name for --output of sbatch, which replaces %a and others.
std::string log_pattern(const std::string& folder, const char* name) {
    std::string text;
    for (const char c : in_slurm(folder, "")) text += c == '%' ? "%%" : std::string(1, c);
    return text + name;
}

std::string part_script(const SlurmWork& work) {
    return fmt::format(
        "#!/bin/sh\n# Task K of the array makes what is missing of part K of {}.\nexec {} --shard "
        "\"$SLURM_ARRAY_TASK_ID/{}\"{}\n",
        work.shards, narpa_line(work.part), work.shards,
        work.limit_threads ? " --threads \"${SLURM_CPUS_ON_NODE:-0}\"" : "");
}

std::string gather_script(const SlurmWork& work) {
    return fmt::format(
        "#!/bin/sh\n# Runs when all tasks of the array have ended.\n{}\nstatus=$?\necho $status >{}\n"
        "exit $status\n",
        narpa_line(work.gather), quoted({in_slurm(work.folder, "gather.status")}));
}

std::string submit_script(const SlurmOptions& o, const SlurmWork& work, const std::vector<Shard>& shards) {
    std::vector<std::string> common{"sbatch", "--parsable", "--requeue", "--open-mode=append",
                                    "--job-name=" + work.name};
    if (o.on.size() > kSlurm.size()) common.push_back("--partition=" + o.on.substr(kSlurm.size() + 1));
    const std::string sbatch = quoted(std::move(common));
    const std::string part =
        quoted({"--array=" + array_indices(shards), "--output=" + log_pattern(work.folder, "part-%a.log")});
    const std::string gather = quoted({"--output=" + log_pattern(work.folder, "gather.log")});
    std::error_code unknown;
    return fmt::format(
        "#!/bin/sh\n# Submits the tasks and the job that gathers; prints the numbers of both.\ncd {} || exit\n"
        "rm -f {}\narray=$({} {} {} {}) || {{ echo \"$array\"; exit 1; }}\narray=${{array%%;*}}\n"
        "gather=$({} --dependency=afterany:\"$array\" {} {} {}) || {{ scancel \"$array\"; echo \"$gather\"; exit "
        "1; "
        "}}\necho \"$array ${{gather%%;*}}\"\n",
        quoted({fs::current_path(unknown).string()}), quoted({in_slurm(work.folder, "gather.status")}), sbatch,
        part, o.sbatch, quoted({in_slurm(work.folder, "part.sh")}), sbatch, gather, o.sbatch,
        quoted({in_slurm(work.folder, "gather.sh")}));
}

Error sbatch_error(const std::string& text, const std::string& script) {
    return {text.empty() ? "sbatch failed" : text, script, 0, 0, ErrorKind::missing, "sinfo"};
}

/// The jobs that are in the queue, one state a line; what squeue said if that cannot be told.
Result<std::vector<std::string>> queued(const std::string& jobs) {
    const ShellResult said = run_by_shell("squeue --noheader --array --format=%T --job=" + quoted({jobs}));
    if (said.status != 0 && said.text.find("Invalid job id") == std::string::npos)
        return Error{said.text, "squeue", 0, 0, ErrorKind::missing};
    std::vector<std::string> states;
    if (said.status != 0) return states;
    std::istringstream lines(said.text);
    for (std::string line; std::getline(lines, line);)
        if (!line.empty()) states.push_back(line);
    return states;
}

}  // namespace

Option SlurmOptions::add_to(Parser command, const std::string& default_jobs) {
    const Option where =
        command
            .option(
                "--on", on,
                "slurm or slurm:PARTITION: make the parts on the nodes of a cluster, as the tasks of a job array, "
                "and gather them in a job after it; -o DIR is on a path that the nodes share")
            .type_name("CLUSTER")
            .check([](const std::string& text) {
                const bool good = text == kSlurm || (text.starts_with("slurm:") && text.size() > 6);
                return good ? std::string() : "expected slurm or slurm:PARTITION, got " + text;
            });
    command.option("--max-jobs", max_jobs, "Tasks of the job array at most (default: " + default_jobs + ")")
        .range(1, 1'000'000)
        .needs(where);
    command.option("--sbatch", sbatch, "Further arguments of sbatch, as \"--time=60 --cpus-per-task=4\"")
        .type_name("\"ARGS\"")
        .needs(where);
    command.flag("--wait", wait, "Wait for the end of the jobs; the exit status is that of the whole").needs(where);
    return where;
}

Status SlurmOptions::check() const {
    if (is_on_path("sbatch")) return Ok{};
    return Error{"--on slurm: there is no sbatch on PATH, expected a machine that submits jobs to a Slurm cluster",
                 {},
                 0,
                 0,
                 ErrorKind::missing,
                 "sudo apt-get install slurm-client"};
}

Status check_not_queued(const std::string& folder) {
    const auto file = read_file(in_slurm(folder, "jobs"));
    if (!file) return Ok{};  // none was submitted
    std::istringstream words(*file);
    std::string array, gather;
    if (!(words >> array >> gather)) return Ok{};
    const auto states = queued(array + "," + gather);
    if (!states) return states.error();
    if (states->empty()) return Ok{};
    return Error{fmt::format("jobs {} and {} are at work on it, {} of their tasks are left: expected to be given "
                             "when they have ended",
                             array, gather, states->size()),
                 folder,
                 0,
                 0,
                 ErrorKind::failed,
                 fmt::format("scancel {} {}", array, gather)};
}

Result<SlurmJobs> submit_to_slurm(const SlurmOptions& o, const SlurmWork& work) {
    const std::vector<Shard> shards = shards_with(work.missing, work.shards);
    std::error_code failed;
    fs::create_directories(in_slurm(work.folder, ""), failed);
    const std::string submit = in_slurm(work.folder, "submit.sh");
    for (const auto& [name, text] :
         {std::pair{"part.sh", part_script(work)}, std::pair{"gather.sh", gather_script(work)},
          std::pair{"submit.sh", submit_script(o, work, shards)}})
        if (Status good = write_file(in_slurm(work.folder, name), text); !good) return good.error();
    const ShellResult said = run_by_shell("sh " + quoted({submit}));
    if (said.status != 0) return sbatch_error(said.text, submit);
    SlurmJobs jobs{{}, {}, shards.size()};
    std::istringstream words(said.text.substr(said.text.rfind('\n') + 1));
    if (!(words >> jobs.array >> jobs.gather)) return sbatch_error(said.text, submit);
    if (Status good = write_file(in_slurm(work.folder, "jobs"), jobs.array + " " + jobs.gather + "\n"); !good)
        return good.error();
    return jobs;
}

std::string submitted_text(const SlurmJobs& jobs, const std::string& what, const std::string& folder) {
    return fmt::format("submitted {} as job {}, {} tasks, and job {}, which gathers; scripts and logs: {}", what,
                       jobs.array, jobs.tasks, jobs.gather, in_slurm(folder, ""));
}

nlohmann::json to_json(const SlurmJobs& jobs) {
    return {{"submitted", {{"array", jobs.array}, {"gather", jobs.gather}, {"tasks", jobs.tasks}}}};
}

Result<int> wait_for_slurm(const SlurmJobs& jobs, const std::string& folder) {
    constexpr std::chrono::seconds kLongest{10};
    Progress progress(fmt::format("waiting for jobs {} and {}", jobs.array, jobs.gather));
    for (std::chrono::seconds pause{1};; pause = std::min(pause * 2, kLongest)) {
        const auto until = std::chrono::steady_clock::now() + pause;
        while (std::chrono::steady_clock::now() < until) {
            if (stop_flag())
                return Error{"no longer waiting: the jobs go on",
                             folder,
                             0,
                             0,
                             ErrorKind::failed,
                             fmt::format("scancel {} {}", jobs.array, jobs.gather)};
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
        }
        const auto states = queued(jobs.array + "," + jobs.gather);
        if (!states) {
            progress.show(states.error().text());
            continue;
        }
        if (states->empty()) break;
        const std::size_t left = std::min(states->size() - 1, jobs.tasks);  // without the job that gathers
        const auto running = std::ranges::count(*states, "RUNNING");
        progress.show(1 - static_cast<double>(left) / static_cast<double>(jobs.tasks),
                      fmt::format("{} of {} tasks, {} running", jobs.tasks - left, jobs.tasks, running));
    }
    const auto text = read_file(in_slurm(folder, "gather.status"));
    const std::string log = in_slurm(folder, "gather.log");
    if (!text)
        return Error{fmt::format("job {} has ended without a result, expected its output: {}", jobs.gather,
                                 rehearsal::last_line(log)),
                     log, 0, 0, ErrorKind::failed};
    return std::atoi(text->c_str());
}

}  // namespace narpa::cli
