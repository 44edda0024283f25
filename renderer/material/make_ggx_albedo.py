#!/usr/bin/env python3
"""Writes ggx_albedo_table.cpp beside itself: how much a rough GGX surface reflects on the first bounce.

The integrals are means over visible normals (E. Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7,
2018): E = <G2/G1> is the albedo with F = 1, and <F G2/G1> / E a mean Fresnel reflectance, kept as the one cosine at
which Fresnel's equations give it. What the numbers are looked up by stands in ggx_albedo.h.
"""
import math
import pathlib

STEPS = 128  # per axis of the integral over normals
ROUGHNESS, MU = 32, 32          # nodes of E
COSINE_ROUGHNESS, COSINE_MU = 16, 24  # nodes of the effective cosine
INDICES = 6
E_MARGIN, COSINE_MARGIN = 0.001, 0.985  # above what interpolation errs, so that no light is ever made


def ior(k):
    """x = (n - 1) / (n + 1) grows as the square of k, to n = 3."""
    x = max(1e-3, 0.5 * (k / (INDICES - 1)) ** 2)
    return (1 + x) / (1 - x)


def fresnel(c, n):
    g = math.sqrt(n * n - 1 + c * c)
    s, p = (c - g) / (c + g), (n * n * c - g) / (n * n * c + g)
    return 0.5 * (s * s + p * p)


def mean_fresnel(n):
    """Kulla and Conty's fit: here only what the tabled means are smooth multiples of."""
    return (n - 1) / (4.08567 + 1.00071 * n)


def alpha_of(i, count):
    return max(0.02, i / (count - 1)) ** 2


def mu_of(j, count, alpha):
    s = (j / (count - 1)) ** 2
    return 1.0 if s >= 1 else max(1e-6, alpha * s / (1 + alpha - s))


def integrate(alpha, mu, indices, schlick):
    """E, the means of F G2/G1 for each index, and that of (1 - cosine)^5 G2/G1."""
    def smith(z):
        return 0.5 * (math.sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1)
    sine = math.sqrt(1 - mu * mu)
    length = math.hypot(alpha * sine, mu)
    wx, wz = alpha * sine / length, mu / length
    to_viewer = smith(mu)
    e, power, means = 0.0, 0.0, [0.0] * len(indices)
    for i in range(STEPS):
        cos_phi, sin_phi = math.cos(math.pi * (i + 0.5) / STEPS), math.sin(math.pi * (i + 0.5) / STEPS)
        for j in range(STEPS):
            z = (1 - (j + 0.5) / STEPS) * (1 + wz) - wz
            r = math.sqrt(max(0.0, 1 - z * z))
            hx, hy, hz = alpha * (r * cos_phi + wx), alpha * r * sin_phi, z + wz
            length = math.sqrt(hx * hx + hy * hy + hz * hz)
            cosine = (hx * sine + hz * mu) / length
            out = 2 * cosine * hz / length - mu
            if out <= 0:
                continue
            weight = (1 + to_viewer) / (1 + to_viewer + smith(out))
            e += weight
            if schlick:
                power += weight * (1 - cosine) ** 5
            for k, n in enumerate(indices):
                means[k] += weight * fresnel(cosine, n)
    count = STEPS * STEPS
    return e / count, [m / count for m in means], power / count


def cosine_at(n, reflectance):
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fresnel(middle, n) > reflectance else (low, middle)
    return low


class Grid:
    """Looks up by roughness and mu just as ggx_albedo.cpp does."""

    def __init__(self, rows):
        self.rows = rows

    def at(self, roughness, mu):
        alpha = roughness * roughness
        r = roughness * (len(self.rows) - 1)
        m = math.sqrt(mu * (1 + alpha) / (mu + alpha)) * (len(self.rows[0]) - 1)
        i, j = min(int(r), len(self.rows) - 2), min(int(m), len(self.rows[0]) - 2)
        u, v = r - i, m - j
        a, b = self.rows[i], self.rows[i + 1]
        return (1 - u) * ((1 - v) * a[j] + v * a[j + 1]) + u * ((1 - v) * b[j] + v * b[j + 1])


def hemispherical(f):
    """2 * integral of f(mu) mu dmu, with nodes dense towards grazing."""
    steps = 2000
    return sum(4 * f(((i + 0.5) / steps) ** 2) * ((i + 0.5) / steps) ** 3 for i in range(steps)) / steps


def main():
    e_rows = []
    for i in range(ROUGHNESS):
        alpha = alpha_of(i, ROUGHNESS)
        e_rows.append([min(1.0, integrate(alpha, mu_of(j, MU, alpha), [], False)[0] + E_MARGIN) for j in range(MU)])
    indices = [ior(k) for k in range(INDICES)]
    cosines = [[] for _ in range(INDICES + 1)]
    for i in range(COSINE_ROUGHNESS):
        alpha = alpha_of(i, COSINE_ROUGHNESS)
        rows = [[] for _ in cosines]
        for j in range(COSINE_MU):
            mu = mu_of(j, COSINE_MU, alpha)
            e, means, power = integrate(alpha, mu, indices, True)
            found = [cosine_at(n, m / e) for n, m in zip(indices, means)] + [1 - (power / e) ** 0.2]
            for row, c in zip(rows, found):
                row.append(COSINE_MARGIN * c / (mu + alpha))
        for table, row in zip(cosines, rows):
            table.append(row)

    e_grid = Grid(e_rows)
    averages = [hemispherical(lambda mu: e_grid.at(i / (ROUGHNESS - 1), mu)) for i in range(ROUGHNESS)]
    reflected = []
    for k, table in enumerate(cosines):
        grid, row = Grid(table), []
        for i in range(COSINE_ROUGHNESS):
            r = i / (COSINE_ROUGHNESS - 1)

            def first_bounce(mu):
                c = min(1.0, grid.at(r, mu) * (mu + r * r))
                return e_grid.at(r, mu) * (fresnel(c, indices[k]) if k < INDICES else (1 - c) ** 5)
            row.append(hemispherical(first_bounce) / (mean_fresnel(indices[k]) if k < INDICES else 1))
        reflected.append(row)

    def block(values, indent):
        lines, line = [], indent
        for v in values:
            text = f"{v:.5g}f, " if "." in f"{v:.5g}" else f"{v:.5g}.0f, "
            if len(line) + len(text) > 117:
                lines.append(line.rstrip())
                line = indent
            line += text
        return "\n".join(lines + [line.rstrip()])

    def flat(nested):
        return [v for row in nested for v in row]

    with open(pathlib.Path(__file__).parent / "ggx_albedo_table.cpp", "w") as out:
        out.write("// Written by make_ggx_albedo.py; do not edit.\n#include \"renderer/material/ggx_albedo.h\"\n\n"
                  "namespace narpa::ggx_table {\n\n// clang-format off\n")
        for name, count, values in (
                ("kAlbedo", "kRoughnessNodes * kMuNodes", flat(e_rows)),
                ("kMeanAlbedo", "kRoughnessNodes", averages),
                ("kCosine", "(kIndexNodes + 1) * kCosineRoughnessNodes * kCosineMuNodes", flat(flat(cosines))),
                ("kMeanReflected", "(kIndexNodes + 1) * kCosineRoughnessNodes", flat(reflected))):
            out.write(f"const float {name}[{count}] = {{\n{block(values, '    ')}\n}};\n")
        out.write("// clang-format on\n\n}  // namespace narpa::ggx_table\n")


if __name__ == "__main__":
    main()
