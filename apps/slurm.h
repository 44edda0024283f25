/// apps/slurm.h - makes parts of a command on the nodes of a Slurm cluster: a job array, and a job that gathers.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/options.h"
#include "base/result.h"

namespace narpa::cli {

/// The options of a command that may run on a cluster.
struct SlurmOptions {
    std::string on;               ///< "slurm" or "slurm:PARTITION"; empty: this machine
    std::optional<int> max_jobs;  ///< tasks of the array
    std::string sbatch;           ///< further arguments of sbatch, read by sh
    bool wait = false;

    /// Adds --on, --max-jobs, --sbatch and --wait; returns --on. `default_jobs`: the default of --max-jobs, for
    /// --help.
    Option add_to(Parser command, const std::string& default_jobs);
    /// An Error, with status 3, if this machine cannot submit.
    [[nodiscard]] Status check() const;
};

/// What is submitted. The current folder and `folder` are on a path that all nodes share.
struct SlurmWork {
    std::string folder;             ///< of the results; the job scripts and logs are in its slurm/
    std::string name;               ///< of the jobs
    std::vector<std::string> part;  ///< arguments of `narpa` that make what is missing of a shard, without --shard
    bool limit_threads = true;      ///< appends --threads with the CPUs that Slurm has given to the task
    std::vector<std::string> gather;     ///< arguments of `narpa` that gather what there is
    std::vector<std::uint32_t> missing;  ///< numbers of what is to be made, from 0
    std::uint32_t shards = 1;            ///< only those with something missing get a task
};

struct SlurmJobs {
    std::string array, gather;  ///< job numbers
    std::size_t tasks = 0;
};
/// An Error if the jobs that submit_to_slurm has submitted for this folder are in the queue still.
[[nodiscard]] Status check_not_queued(const std::string& folder);
/// Writes part.sh, gather.sh and submit.sh into FOLDER/slurm and runs the last. Errors: those of sbatch.
Result<SlurmJobs> submit_to_slurm(const SlurmOptions& options, const SlurmWork& work);
/// "submitted 12 images as job 7, 4 tasks, and job 8, which gathers". `what`: "12 images".
[[nodiscard]] std::string submitted_text(const SlurmJobs& jobs, const std::string& what, const std::string& folder);
[[nodiscard]] nlohmann::json to_json(const SlurmJobs& jobs);
/// Waits for the end of the jobs and shows progress; returns the exit status of the gathering command. Errors: it
/// has none; interrupted, while the jobs go on.
Result<int> wait_for_slurm(const SlurmJobs& jobs, const std::string& folder);

}  // namespace narpa::cli
