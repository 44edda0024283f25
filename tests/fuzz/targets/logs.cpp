// The logs that `narpa replay` and `narpa estimate` read: a ledger (CSV), run.json and rehearsal.json.
#include <nlohmann/json.hpp>

#include "emulator/log/ledger_log.h"
#include "emulator/log/run_record.h"
#include "rehearsal/runner/rerun.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const std::string_view text = fuzz::text_of(data, size);
    if (!text.starts_with("{")) {
        const auto frames = read_ledger_log(folder.write("nav.ledger.csv", text));
        if (!fuzz::count(bool(frames)))
            fuzz::require(!frames.error().what.empty() && frames.error().line >= 0, "an error has words");
        return 0;
    }
    folder.write("run.json", text);
    const auto run = read_run_record(folder.path());
    if (!fuzz::count(bool(run))) fuzz::require(!run.error().what.empty(), "an error has words");
    folder.write("rehearsal.json", text);
    const auto record = rehearsal::read_record(folder.path());
    if (!fuzz::count(bool(record))) fuzz::require(!record.error().what.empty(), "an error has words");
    return 0;
}
