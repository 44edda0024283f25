// narpa judge - judges logged rehearsals anew, by their own gates or by others.
#include <memory>

#include "apps/cli.h"
#include "apps/commands/rehearsal_text.h"
#include "rehearsal/runner/rejudge.h"
#include "rehearsal/runner/run_folder.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

struct JudgeOptions {
    std::string folder, gates;
};

Outcome judge(const JudgeOptions& o) {
    std::error_code failed;
    if (!std::filesystem::is_directory(o.folder, failed)) return Error{"no such folder", o.folder};
    const auto kind = rehearsal::kind_of_folder(o.folder);
    if (!kind) return kind.error();
    std::string gates;
    if (!o.gates.empty()) {
        const auto file = find_file(FileKind::scenario, o.gates);
        if (!file) return file.error();
        gates = *file;
    }
    if (*kind == rehearsal::FolderKind::summary)
        return Error{
            "holds the summary of campaigns elsewhere: judge those, then `narpa rehearse --merge` them again",
            o.folder};
    if (*kind == rehearsal::FolderKind::run) return print_run(rehearsal::judge_run(o.folder, gates));
    auto summary = [&] {
        Progress progress("judging");
        return rehearsal::judge_campaign(o.folder, gates,
                                         {say, [&](double share, double left_s, std::string_view text) {
                                              progress.show({share, std::string(text), left_s});
                                          }});
    }();
    return print_campaign(std::move(summary), o.folder);
}

}  // namespace

Command add_judge(Parser app) {
    auto o = std::make_shared<JudgeOptions>();
    const Parser c = app.subcommand(
        "judge", "Judge what `rehearse` has flown anew, by other gates or by its own: nothing is flown again");
    c.option("DIR", o->folder, "Folder of a rehearsal or of a campaign; its verdicts and reports are written anew")
        .required();
    c.option("--gates", o->gates,
             "Scenario whose [gates] and duration_s to apply; the rest must be what was flown (default: the gates "
             "that were flown with)")
        .type_name("SCENARIO");
    c.footer("Exit status: 0 all gates passed; 1 one failed; 2 bad input.");
    c.group("Results");
    c.examples({"narpa judge out/rehearsal/docking", "narpa judge out/campaign --gates mine.toml"});
    return [o] { return judge(*o); };
}

}  // namespace narpa::cli
