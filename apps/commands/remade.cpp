#include "apps/commands/remade.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "apps/warnings.h"
#include "emulator/threads.h"

namespace narpa::cli {

Status make_again(const RunEstimate& o, Replay& run, std::size_t i) {
    const std::vector<std::string> differs = run.make(i);
    if (differs.empty()) return Ok{};
    return Error{
        fmt::format("frame {} is not the run's any more: {}; expected the scene and the program as they were",
                    run.frames()[i].ledger.frame, differs.front()),
        o.folder + "/" + run.camera().name + ".ledger.csv", run.frames()[i].line};
}

Status each_frame(const RunEstimate& o, Replay& run, const std::function<Status(std::size_t)>& take,
                  const std::function<void(std::size_t)>& pass) {
    TracingThreads threads(o.threads);
    Progress progress("estimating poses of " + o.folder);
    const std::size_t n = run.frames().size();
    for (std::size_t i = 0; i < n; ++i) {
        const FrameLedger& ledger = run.frames()[i].ledger;
        const bool is_wanted =
            i % static_cast<std::size_t>(o.every) == 0 && run.has_image(i) && ledger.delivery == Delivery::frame;
        if (!is_wanted) {
            if (pass) pass(i);
            continue;
        }
        progress.show(static_cast<double>(i) / static_cast<double>(n), fmt::format("frame {} of {}", i + 1, n));
        Status done = Ok{};
        threads.arena.execute([&] {
            done = make_again(o, run, i);
            if (done) done = take(i);
        });
        if (!done) return done;
    }
    return Ok{};
}

Status each_sweep(const RunEstimate& o, SweepReplay& run, const std::function<void(const ReplayedSweep&)>& take) {
    TracingThreads threads(o.threads);
    Progress progress("estimating poses of " + o.folder);
    std::size_t taken = 0, others = 0;
    ReplayedSweep made;
    const auto next = [&] {
        if (!run.next(taken == 0 ? 0 : static_cast<std::size_t>(o.every) - 1, made)) return false;
        take(made);
        ++taken;
        return true;
    };
    while (threads.arena.execute(next)) {
        progress.show(fmt::format("sweep {}, t = {:.1f} s", made.sweep, 1e-9 * static_cast<double>(made.t_ns)));
        if (made.repeats.value_or(true)) continue;
        if (run.is_lockstep())
            return Error{fmt::format("sweep {} is not the run's any more: expected the scene and the program as "
                                     "they were",
                                     made.sweep),
                         run.log_file(), made.line};
        ++others;
    }
    if (others > 0)
        warn(
            fmt::format("{}: {} of {} sweeps differ from those of the run: in real time, poses came too late for "
                        "their packets",
                        run.log_file(), others, taken));
    return Ok{};
}

}  // namespace narpa::cli
