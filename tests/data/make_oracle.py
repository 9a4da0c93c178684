#!/usr/bin/env python3
"""Writes spectra.json and responses.json: second-order systems with their spectra and responses, right to 30 digits and more.

Usage: make_oracle.py [--folder .] [--largest 40] [--only spectra|responses]
Needs Python >= 3.9 and mpmath (Debian: python3-mpmath), nothing else. Deterministic: every random system stores its seed.

Truth means truth of the *stored doubles*. How each eigenvalue is known is told in exact.py: the characteristic polynomial is exact,
multiple, zero and imaginary roots are split off exactly, and an exactly evaluated disc proves each simple root. Checked here besides,
by routes that share nothing with the polynomial: sum and sum of squares of the eigenvalues against traces, their product against
determinants, residuals of inverse iteration at each eigenvalue at 60 and (of large systems a sample) at 90 digits, and for small systems
mpmath's QR algorithm at two precisions.
"""

import argparse
import json
import os
import sys
import time
from fractions import Fraction

from mpmath import mp, mpf

sys.dont_write_bytecode = True  # no __pycache__ among the data
import exact
from systems import hard_families, random_systems


def to_mp(a):
    return mp.matrix([[exact.fraction_to_mpf(x) for x in row] for row in a])


def doubles(a):
    result = [[float(x) for x in row] for row in a]
    assert [[Fraction(x) for x in row] for row in result] == a
    return [[int(x) if x == int(x) and abs(x) < 2**53 else x for x in row] for row in result]


def check_moments(s, eigenvalues):
    """Traces of the state matrix and of its square, and the determinants, at 120 digits."""
    with mp.workdps(120):
        M, C, K = (to_mp(s[k]) for k in "MCK")
        inverse = M**-1
        D, G = inverse * C, inverse * K
        z = [mp.mpc(exact.fraction_to_mpf(re), exact.fraction_to_mpf(im)) for re, im in eigenvalues]
        trace = lambda a: sum(a[i, i] for i in range(a.rows))
        size = sum(abs(x) for x in z)
        assert abs(sum(z) + trace(D)) <= size * mpf(10) ** -33, s["name"]
        size = sum(abs(x) ** 2 for x in z)
        assert abs(sum(x * x for x in z) - trace(D * D) + 2 * trace(G)) <= size * mpf(10) ** -33, s["name"]
        product = mp.fprod(x for x in z)
        determinant = mp.det(K) / mp.det(M) if all(x != 0 for x in z) else mpf(0)
        assert abs(product - determinant) <= abs(product) * mpf(10) ** -32, s["name"]


def check_residuals(s, stored):
    """Inverse iteration at the stored hi + lo values, at 60 and (every one up to n = 8, then a sample) 90 digits: the backward error
    is that of their rounding. Returns the condition numbers: |x|'(|z|^2 |M| + |z| |C| + |K|)|x| / (|z| |x'(2 z M + C) x|) is how much
    z changes relatively, to first order, for an entrywise relative change of the data; None for zero and multiple eigenvalues."""
    n = len(s["M"])
    conditions = {}
    for digits, every in ((60, 1), (90, 1 if n <= 8 else n // 3)):
        with mp.workdps(digits):
            M, C, K = (to_mp(s[k]) for k in "MCK")
            norms = [mp.mnorm(a, mp.inf) for a in (M, C, K)]
            entries = [a.apply(abs) for a in (M, C, K)]
            for re, im in stored[::every]:
                z = mp.mpc(mpf(re[0]) + mpf(re[1]), mpf(im[0]) + mpf(im[1]))
                if z == 0 or mp.im(z) < 0:
                    continue
                size = abs(z) ** 2 * norms[0] + abs(z) * norms[1] + norms[2]
                Q = z * z * M + z * C + K
                LU, order = mp.LU_decomp(Q + size * mpf(10) ** (5 - digits) * mp.eye(n))
                x = mp.matrix([mpf(1) / (i + 1) + mpf(1) / 7 for i in range(n)])
                for _ in range(3):
                    x = mp.U_solve(LU, mp.L_solve(LU, x, order))
                    x /= mp.norm(x)
                residual = mp.norm(Q * x) / size
                assert residual < mpf(10) ** -29, (s["name"], residual)
                absolute = x.apply(abs)
                numerator = (absolute.T * (abs(z) ** 2 * entries[0] + abs(z) * entries[1] + entries[2]) * absolute)[0]
                denominator = abs(z) * abs((x.T * (2 * z * M + C) * x)[0])
                condition = float(numerator / denominator) if stored.count([re, im]) == 1 else None
                if str((re, im)) in conditions and condition:
                    assert abs(conditions[str((re, im))] / condition - 1) < 1e-6, s["name"]
                conditions[str((re, im))] = condition
    upper = [(re, [abs(im[0]), im[1] if im[0] >= 0 else -im[1]]) for re, im in stored]
    return [float(f"{c:.4g}") if (c := conditions.get(str(z))) else None for z in upper]


def check_against_qr(s, eigenvalues):
    """mpmath's eig at two precisions; a defective double eigenvalue keeps half of the digits."""
    for digits in (70, 140):
        with mp.workdps(digits):
            M, C, K = (to_mp(s[k]) for k in "MCK")
            n = M.rows
            inverse = M**-1
            A = mp.matrix(2 * n)
            for i in range(n):
                A[i, n + i] = 1
            A[n:2 * n, 0:n], A[n:2 * n, n:2 * n] = -inverse * K, -inverse * C
            left = list(mp.eig(A, left=False, right=False))
            scale = max(abs(x) for x in left)
            for re, im in eigenvalues:
                z = mp.mpc(exact.fraction_to_mpf(re), exact.fraction_to_mpf(im))
                partner = min(left, key=lambda x: abs(x - z))
                assert abs(partner - z) <= max(scale * mpf(10) ** (12 - digits / 2), abs(z) * mpf(10) ** -32), s["name"]
                left.remove(partner)


def spectrum_record(s):
    M, C, K = s["M"], s["C"], s["K"]
    n = len(M)
    for a in (M, C, K):
        assert a == exact.transpose(a), s["name"]
    assert exact.is_positive_definite(M), s["name"]
    zero_modes = exact.null_space(K)
    r = len(zero_modes)
    if s.get("stiffness_factor"):
        assert exact.multiply(exact.transpose(s["stiffness_factor"]), s["stiffness_factor"]) == K
    couples = damps = False
    if r:
        U = exact.transpose(zero_modes)
        CU, MU = exact.multiply(C, U), exact.multiply(M, U)
        damps = any(x for row in CU for x in row)
        couples = exact.rank([a + b for a, b in zip(MU, CU)]) > r  # U' C V = 0 for every V M-orthogonal to U: C U within M U
    eigenvalues = exact.spectrum(M, C, K)
    stored = [[exact.hi_lo(re), exact.hi_lo(im)] for re, im in eigenvalues]
    check_moments(s, eigenvalues)
    conditions = check_residuals(s, stored)
    if n <= 4:
        check_against_qr(s, eigenvalues)
    record = {"name": s["name"], "family": s["family"], "seed": s["seed"], "n": n, "r": r, "exact": s["exact"],
              "damping_semidefinite": exact.is_positive_semidefinite(C), "stiffness_semidefinite": exact.is_positive_semidefinite(K),
              "couples_zero_modes": couples, "damps_zero_modes": damps,
              "mass": doubles(M), "damping": doubles(C), "stiffness": doubles(K)}
    for key in ("stiffness_factor", "jacobian", "task_stiffness", "task_damping"):
        if s.get(key):
            record[key] = doubles(s[key])
    if "prescribed_damping_ratios" in s:
        record["prescribed_damping_ratios"] = s["prescribed_damping_ratios"]
    record["eigenvalues"] = [[[x if x else 0 for x in part] for part in z] for z in stored]
    record["conditions"] = conditions
    return record


def write(path, what, note, records):
    with open(path, "w") as file:
        file.write("{\n" + f'"note": {json.dumps(note)},\n"{what}": [\n')
        file.write(",\n".join(json.dumps(r, separators=(",", ":")) for r in records))
        file.write("\n]\n}\n")
    print(path, len(records), "systems,", os.path.getsize(path), "bytes")


def make_spectra(folder, largest):
    records, start = [], time.time()
    for build in random_systems() + hard_families():
        before = time.time()
        s = build()
        if len(s["M"]) > largest:
            continue
        records.append(spectrum_record(s))
        print(f"{s['name']}: n {records[-1]['n']}, r {records[-1]['r']}, {time.time() - before:.2f} s", flush=True)
    names = [r["name"] for r in records]
    assert len(set(names)) == len(names)
    note = ("Written by make_oracle.py. SI units. Eigenvalues of lambda^2 M + lambda C + K for the stored doubles: "
            "[[re_hi, re_lo], [im_hi, im_lo]] in rad/s, hi + lo right to 1e-32 of each part; parts that are exactly zero are 0. "
            "conditions: relative change of each per entrywise relative change of the data, null for zero and multiple ones.")
    write(os.path.join(folder, "spectra.json"), "systems", note, records)
    print(f"spectra: {time.time() - start:.0f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", default=os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--largest", type=int, default=40, help="leave out larger systems")
    parser.add_argument("--only", choices=["spectra", "responses"])
    options = parser.parse_args()
    mp.dps = 60
    if options.only != "responses":
        make_spectra(options.folder, options.largest)
    if options.only != "spectra":
        from responses import make_responses
        make_responses(options.folder)


if __name__ == "__main__":
    main()
