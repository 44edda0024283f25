"""Charts of the pages of a rehearsal and of a campaign. Positions: the chaser's port in the axes of the target's port."""
import math

import numpy as np

from narpa.plots.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILION, figure

PHASE_COLOURS = {"holding": GREEN, "transferring": SKY}  # other phases cycle through OTHER_PHASES
OTHER_PHASES = (ORANGE, PURPLE, VERMILION, GREY)
WIDE, HALF = 11.6, 5.7  # inches: widths for one and two charts in a row
CIRCLES = 40  # largest number of estimates drawn in a view
ROWS_OF_SAMPLES = 3000  # largest number in an SVG; more are decimated


def thin(rows):
    """At most ROWS_OF_SAMPLES of the rows, evenly spaced."""
    rows = np.asarray(rows, float)
    return rows[:: max(1, math.ceil(len(rows) / ROWS_OF_SAMPLES))]


def circle(axes, radius, colour, label=None, style="--"):
    angle = np.linspace(0, 2 * np.pi, 181)
    axes.plot(radius * np.cos(angle), radius * np.sin(angle), style, color=colour, linewidth=1.1, label=label)


def half_width(document, axis):
    """Half the width of a view that contains the path across this axis, with a small margin."""
    values = [abs(row[axis]) for row in (*document["truth"]["position_m"], *document["holds_m"])]
    return 1.3 * max([0.15, *values])


def view(document, title, along, across):
    """The approach, projected on two axes."""
    drawn = figure(HALF, 3.4)
    axes = drawn.subplots()
    gates, truth = document["gates"], thin(document["truth"]["position_m"]).reshape(-1, 3)
    low, high = min([0, *truth[:, 0]]), max([1, *truth[:, 0]])
    margin = 0.04 * (high - low)
    left, right = (low - margin, high + margin) if along == 0 else (-half_width(document, 1), half_width(document, 1))
    corridor = gates["corridor"]
    if corridor and along == 0:
        x = np.array([max(0, left), min(corridor["from_m"], right)])
        edge = corridor["radius_m"] + x * math.tan(math.radians(corridor["half_angle_deg"]))
        axes.fill_between(x, -edge, edge, color=GREEN, alpha=0.18, linewidth=0, label="corridor")
    elif corridor:
        circle(axes, corridor["radius_m"], GREEN, "corridor at the port")
    if gates["keep_out_m"]:
        circle(axes, gates["keep_out_m"], VERMILION, "keep-out sphere")
    if gates["distance_m"]:
        circle(axes, gates["distance_m"][0], VERMILION, "distance allowed")
        circle(axes, gates["distance_m"][1], VERMILION)
    axes.plot(truth[:, along], truth[:, across], color=BLUE, linewidth=1.8, label="true")
    estimated = np.array(document["estimates"]["port_position_m"], float).reshape(-1, 3)
    estimated = estimated[:: max(1, len(estimated) // CIRCLES)]  # open circles keep the line visible
    axes.plot(estimated[:, along], estimated[:, across], "o", color=VERMILION, markersize=4, markerfacecolor="none",
              markeredgewidth=0.9, label="estimated")  # fmt: skip
    holds = np.array(document["holds_m"], float).reshape(-1, 3)
    axes.plot(holds[:, along], holds[:, across], "o", color=INK, markersize=4.5, label="hold points")
    axes.set_xlim(left, right)
    axes.set_ylim(-half_width(document, across), half_width(document, across))
    if gates["distance_m"] or along == 1:
        axes.set_aspect("equal", adjustable="datalim")
    return labelled(drawn, axes, title, f"{'xyz'[along]} [m]", f"{'xyz'[across]} [m]")


def labelled(drawn, axes, title, x, y):
    """Adds title, axis labels, and a legend between title and axes in rows of four."""
    entries = len(axes.get_legend_handles_labels()[0])
    rows = -(-entries // 4)
    axes.set_title(title, loc="left", pad=6 + 14 * rows)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if entries:
        legend = axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 0.99), ncol=4, borderpad=0.1, handlelength=1.3,
                             columnspacing=1, labelspacing=0.2, fontsize=8)  # fmt: skip
        legend.set_in_layout(False)  # it may be wider than the axes
    return drawn


def last_metres(document):
    drawn = figure(HALF, 3.4)
    axes = drawn.subplots()
    limit = document["gates"]["contact"]["lateral_m"]
    end = np.array([row for row in document["truth"]["position_m"] if row[0] < 3], float).reshape(-1, 3)
    axes.plot(end[:, 1], end[:, 2], color=BLUE, linewidth=1.8, label="true")
    circle(axes, limit, GREEN, "lateral misalignment allowed")
    if document["contact"]:
        axes.plot(*document["contact"]["position_m"][1:], "o", color=VERMILION, markersize=6, label="contact")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_ylim(-2 * limit, 2 * limit)
    return labelled(drawn, axes, "The last three metres, from the front", "y [m]", "z [m]")


def profile(document):
    """The descent from the side: height over the horizontal distance from the site."""
    drawn = figure(HALF, 3.4)
    axes = drawn.subplots()
    truth = thin(document["truth"]["position_m"]).reshape(-1, 3)
    estimated = np.array(document["estimates"]["port_position_m"], float).reshape(-1, 3)
    estimated = estimated[:: max(1, len(estimated) // CIRCLES)]
    axes.plot(np.hypot(truth[:, 1], truth[:, 2]), truth[:, 0], color=BLUE, linewidth=1.8, label="true")
    axes.plot(np.hypot(estimated[:, 1], estimated[:, 2]), estimated[:, 0], "o", color=VERMILION, markersize=4, markerfacecolor="none",
              markeredgewidth=0.9, label="estimated")  # fmt: skip
    return labelled(drawn, axes, "From the side", "horizontal distance from the site [m]", "height [m]")


def track(document):
    """The last part of the descent from above, with the circle of allowed landing positions around the site."""
    drawn = figure(HALF, 3.4)
    axes = drawn.subplots()
    limit = document["landing"]["from_site_m"]
    truth = np.array(document["truth"]["position_m"], float).reshape(-1, 3)
    truth = truth[np.hypot(truth[:, 1], truth[:, 2]) < 5 * limit]
    axes.plot(truth[:, 2], -truth[:, 1], color=BLUE, linewidth=1.8, label="true")
    circle(axes, limit, GREEN, "allowed at the touchdown")
    if document["contact"]:
        _, y, z = document["contact"]["position_m"]
        axes.plot(z, -y, "o", color=VERMILION, markersize=6, label="touchdown")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(-2.5 * limit, 2.5 * limit)
    return labelled(drawn, axes, "The site, from above", "z of the site [m]", "-y of the site [m]")


def landing(document):
    limits = document["landing"]
    position = np.array(document["truth"]["position_m"], float).reshape(-1, 3)
    document["truth"]["height_m"] = position[:, 0]
    document["truth"]["site_m"] = np.hypot(position[:, 1], position[:, 2])
    allowed = "vertical velocity allowed at the touchdown"
    return {
        "profile": profile(document),
        "track": track(document),
        "height": over_time(document, "Height above the site", "[m]", [("height_m", BLUE, None)]),
        "velocity": over_time(document, "Velocity", "[m/s]", [("closing_m_s", BLUE, "downwards"), ("lateral_m_s", VERMILION, "horizontal")],
                              [limits["vertical_m_s"]], allowed),
        "site": over_time(document, "Horizontal distance from the site", "[m]", [("site_m", BLUE, None)]),
    }  # fmt: skip


def shade_phases(document, axes):
    """Shades the guidance's phases behind the curves; phase and leg are written where there is room."""
    span = max(1e-9, document["t_end_s"])
    others = {}
    for phase in document["phases"]:
        colour = PHASE_COLOURS.get(phase["phase"]) or others.setdefault(phase["phase"], OTHER_PHASES[len(others) % 4])
        axes.axvspan(phase["from_s"], phase["to_s"], color=colour, alpha=0.13, linewidth=0)
        label = f"{phase['phase'].replace('_', ' ')} {phase['leg']}"
        if (phase["to_s"] - phase["from_s"]) / span > 0.0075 * len(label):
            axes.text(phase["from_s"], 0.98, " " + label, transform=axes.get_xaxis_transform(), va="top", fontsize=7.5)
    axes.set_xlim(0, span)


def over_time(document, title, unit, curves, limits=(), allowed="closing rate allowed at contact"):
    drawn = figure(WIDE, 2.7)
    axes = drawn.subplots()
    shade_phases(document, axes)
    for key, colour, label in curves:
        t, values = thin(np.column_stack([document["truth"]["t_s"], document["truth"][key]])).T
        axes.plot(t, values, color=colour, label=label)
    for k, limit in enumerate(limits):
        axes.axhline(limit, color=GREEN, linestyle="--", linewidth=1, label=None if k else allowed)
    return labelled(drawn, axes, title, "t [s]", unit)


def error_chart(document, quantity, axis):
    """One component of the navigation error with its 3-sigma band."""
    e, contact = document["estimates"], document["contact"]
    scale, unit, stored = (100, "cm", "m") if quantity == "position" else (math.degrees(1), "deg", "rad")
    error, sigma = (scale * np.array(e[f"{quantity}_{what}_{stored}"])[:, axis] for what in ("error", "sigma"))
    rows = np.column_stack([e["t_s"], error, 3 * sigma])
    if contact and contact["captured"]:
        rows = rows[rows[:, 0] <= contact["t_s"]]  # after capture the two bodies are one
    drawn = figure(0.66 * HALF, 2.35)
    axes = drawn.subplots()
    if len(rows):
        settled = np.abs(rows[rows[:, 0] > 0.03 * document["t_end_s"], 1])
        span = max(1.25 * settled.max(initial=0), 1.2 * np.median(rows[:, 2]), 1e-6)  # the transient at the start would dominate the scale
        t, error, sigma = thin(rows).T
        axes.fill_between(t, np.maximum(-sigma, -span), np.minimum(sigma, span), color=SKY, alpha=0.3, linewidth=0, label="3 sigma")
        axes.plot(t, error, color=BLUE, linewidth=1.2, label="error")
        axes.set_ylim(-span, span)
    for key, colour in (("frame_times_s", VERMILION), ("sweep_times_s", GREEN)):
        if e[key]:
            times = thin(e[key])
            axes.plot(times, np.full(len(times), 0.02), "|", color=colour, markersize=5, transform=axes.get_xaxis_transform(),
                      label=key.split("_")[0] + "s", rasterized=len(times) > 300)  # fmt: skip
    name = f"Position {'xyz'[axis]}" if quantity == "position" else f"Attitude about {'xyz'[axis]}"
    return labelled(drawn, axes, name, "t [s]", f"[{unit}]")


def thruster_charts(document):
    """The commanded impulses, and the accumulated delta-v."""
    commands, charts = document["thrusters"], {}
    t, impulses = np.array(commands["t_s"], float), np.array(commands["impulse_n_s"], float).reshape(-1, 3)
    drawn = figure(WIDE, 2.7)
    axes = drawn.subplots()
    shade_phases(document, axes)
    for axis, colour in enumerate((BLUE, VERMILION, GREEN)):
        rows = thin(np.column_stack([t, impulses[:, axis]]))
        axes.step(*rows.T, where="post", color=colour, linewidth=1.1, label="xyz"[axis])
    charts["impulses"] = labelled(drawn, axes, "Commanded impulses, chaser's axes", "t [s]", "[N s]")
    drawn = figure(WIDE, 2.4)
    axes = drawn.subplots()
    shade_phases(document, axes)
    axes.step(*thin(np.column_stack([t, commands["delta_v_m_s"]])).T, where="post", color=BLUE)
    charts["delta_v"] = labelled(drawn, axes, "Delta-v commanded so far", "t [s]", "[m/s]")
    return charts


def latency_chart(document):
    drawn = figure(WIDE, 2.4)
    axes = drawn.subplots()
    axes.plot(document["latency"]["t_s"], document["latency"]["ms"], ".", color=BLUE, markersize=3,
              rasterized=len(document["latency"]["t_s"]) > 300)  # fmt: skip
    return labelled(drawn, axes, "Pose command to hand-over", "t [s]", "[ms]")


def approach(document):
    contact_limits = document["gates"]["contact"]
    charts = {
        "above": view(document, "From above", 0, 1),
        "side": view(document, "From the side", 0, 2),
        "front": view(document, "From the front", 1, 2),
    }
    if contact_limits:
        charts["contact"] = last_metres(document)
    charts["range"] = over_time(document, "Range", "between the ports [m]", [("range_m", BLUE, None)])
    limits = contact_limits["closing_m_s"] if contact_limits else ()
    charts["rates"] = over_time(document, "Rates", "[m/s]", [("closing_m_s", BLUE, "closing"), ("lateral_m_s", VERMILION, "lateral")], limits)
    return charts


def rehearsal(document):
    charts = landing(document) if "landing" in document else approach(document)
    if document["estimates"]["t_s"]:
        for quantity in ("position", "attitude"):
            for axis in range(3):
                charts[f"{quantity}_{'xyz'[axis]}"] = error_chart(document, quantity, axis)
    if document["thrusters"]["t_s"]:
        charts.update(thruster_charts(document))
    if document["latency"]["t_s"]:
        charts["latency"] = latency_chart(document)
    return charts


def campaign(document):
    """States at contact over all runs, with the limits."""
    charts = {}

    def chart(name, title, x, y, points, outline):
        drawn = charts[name] = figure(3.7, 3.6)
        axes = drawn.subplots()
        axes.plot(*outline, "--" if name == "where" else "-", color=GREEN, linewidth=1.1, label="allowed")
        for within, colour in ((True, BLUE), (False, VERMILION)):
            chosen = np.array([p for p, run in zip(points, document["runs"]) if run["within"] == within], float).reshape(-1, 2)
            if len(chosen):
                axes.plot(*chosen.T, "o", color=colour, markersize=4, label="within" if within else "beyond")
        axes.set_aspect("equal" if name == "where" else "auto", adjustable="datalim")
        labelled(drawn, axes, title, x, y)

    angle, runs = np.linspace(0, 2 * np.pi, 181), document["runs"]
    if "landing" in document:
        limits = document["landing"]
        site, down, across = limits["from_site_m"], limits["vertical_m_s"], limits["horizontal_m_s"]
        chart("where", "Where they touched down", "z of the site [m]", "-y of the site [m]",
              [(run["position_m"][2], -run["position_m"][1]) for run in runs], (site * np.cos(angle), site * np.sin(angle)))  # fmt: skip
        chart("rates", "Velocities", "vertical [m/s]", "horizontal [m/s]", [(run["closing_m_s"], run["lateral_m_s"]) for run in runs],
              ([0, down, down, 0, 0], [0, 0, across, across, 0]))  # fmt: skip
        tilt, rate = limits["tilt_deg"], limits["rate_deg_s"]
        chart("tilt", "Tilt and angular rate", "tilt [deg]", "rate [deg/s]", [(run["tilt_deg"], run["rate_deg_s"]) for run in runs],
              ([0, tilt, tilt, 0, 0], [0, 0, rate, rate, 0]))  # fmt: skip
        return charts
    limits = document["limits"]
    lateral = 100 * limits["lateral_m"]
    low, high = (100 * v for v in limits["closing_m_s"])
    rate, pitch, roll = 100 * limits["lateral_m_s"], limits["pitch_yaw_deg"], limits["roll_deg"]
    chart("where", "Where the ports met", "y [cm]", "z [cm]", [[100 * v for v in run["position_m"][1:]] for run in runs],
          (lateral * np.cos(angle), lateral * np.sin(angle)))  # fmt: skip
    chart("rates", "Rates", "closing [cm/s]", "lateral [cm/s]", [(100 * run["closing_m_s"], 100 * run["lateral_m_s"]) for run in runs],
          ([low, high, high, low, low], [0, 0, rate, rate, 0]))  # fmt: skip
    chart("angles", "Angles", "pitch and yaw [deg]", "roll [deg]", [(run["pitch_yaw_deg"], run["roll_deg"]) for run in runs],
          ([0, pitch, pitch, 0, 0], [0, 0, roll, roll, 0]))  # fmt: skip
    return charts


KINDS = {"rehearsal": rehearsal, "campaign": campaign}
