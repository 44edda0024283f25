#include "bench/latency.h"

#include <fmt/format.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "base/time.h"
#include "bench/statistics.h"

namespace narpa {
namespace {

constexpr int kWarmUp = 5;  // the first ones: buffers are mapped, streams begin

/// State that sender and receiver share.
struct LatencyExchange {
    std::mutex mutex;
    std::condition_variable changed;
    std::optional<std::uint32_t> arrived{};  ///< the newest
    std::uint32_t sent = 0;                  ///< the newest
    std::int64_t t_sent_ns = 0;
    int lost = 0;
    bool over = false;
    Status joined{Ok{}};
};

/// Sends the messages in order, each once the previous one has arrived or timed out.
void send_all(const LatencyEnds& ends, const LatencySettings& s, LatencyExchange& x) {
    Status joined = ends.join ? ends.join() : Status{Ok{}};
    std::unique_lock lock(x.mutex);
    x.joined = std::move(joined);
    for (std::uint32_t k = 0; x.joined && !x.over; ++k) {
        lock.unlock();
        std::this_thread::sleep_for(std::chrono::nanoseconds(s.pause_ns));
        const std::int64_t t_ns = monotonic_ns();
        {
            const std::lock_guard before(x.mutex);
            x.t_sent_ns = t_ns;
            x.sent = k;
        }
        (void)ends.send(k);
        lock.lock();
        const bool came = x.changed.wait_for(lock, std::chrono::nanoseconds(s.patience_ns),
                                             [&] { return x.over || x.arrived == k; });
        if (!came && k >= kWarmUp) ++x.lost;
    }
    x.over = true;
}

}  // namespace

Result<LatencyRow> measure_latency(const LatencyEnds& ends, const LatencySettings& s, const StopFlag& stop) {
    LatencyExchange x;
    std::thread sender([&] { send_all(ends, s, x); });
    LatencyRow row;
    constexpr std::int64_t kPollPeriod_ns = 50'000'000;
    std::int64_t t_came_ns = monotonic_ns();
    const auto ended = [&] {
        const std::lock_guard lock(x.mutex);
        return x.over;
    };
    const auto wanted = static_cast<std::size_t>(s.count);
    while (row.latencies_s.size() < wanted && !stop && !ended()) {
        const auto number = ends.receive(kPollPeriod_ns);
        const std::int64_t now_ns = monotonic_ns();
        if (!number) {
            if (now_ns - t_came_ns > 4 * s.patience_ns) break;
            continue;
        }
        t_came_ns = now_ns;
        const std::lock_guard lock(x.mutex);
        x.arrived = number;
        x.changed.notify_one();
        if (*number >= kWarmUp && *number == x.sent) row.latencies_s.push_back(to_seconds(now_ns - x.t_sent_ns));
    }
    {
        const std::lock_guard lock(x.mutex);
        x.over = true;
        x.changed.notify_one();
    }
    sender.join();
    row.lost = x.lost;
    if (!x.joined) return x.joined.error();
    if (row.latencies_s.empty() && !stop) return Error{.what = "nothing arrived", .kind = ErrorKind::failed};
    return row;
}

nlohmann::json to_json(const LatencyRow& row) {
    const auto at = [&](double p) { return quantile(row.latencies_s, p); };
    return {{"what", row.what}, {"by", row.by},     {"count", row.latencies_s.size()},
            {"lost", row.lost}, {"p50_s", at(0.5)}, {"p99_s", at(0.99)},
            {"max_s", at(1.0)}};
}

std::string to_text(const std::vector<LatencyRow>& rows) {
    std::string text = fmt::format("{:<28} {:<40} {:>6} {:>9} {:>9} {:>9} {:>5}", "what", "by", "count", "p50, ms",
                                   "p99, ms", "max, ms", "lost");
    for (const LatencyRow& r : rows)
        text += fmt::format("\n{:<28} {:<40} {:>6} {:>9.3f} {:>9.3f} {:>9.3f} {:>5}", r.what, r.by,
                            r.latencies_s.size(), 1e3 * quantile(r.latencies_s, 0.5),
                            1e3 * quantile(r.latencies_s, 0.99), 1e3 * quantile(r.latencies_s, 1), r.lost);
    return text;
}

}  // namespace narpa
