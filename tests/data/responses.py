"""Writes responses.json: free, impulse, constant-force, harmonic and sampled responses, and the receptance, of a dozen systems.

Each response is a column of the exponential of an augmented state matrix, in fixed-point arithmetic on Python integers: Taylor series
of the matrix scaled below 2^-8, then squaring. It is done with two precisions, which must agree to 1e-40 of the largest
entry and 1e-25 of each. The shorter times are checked besides by Taylor series of q(t) itself, stepped, from M q'' + C q' + K q = f.
"""

import os
import time
from fractions import Fraction

from mpmath import mp, mpf

import exact
from exact import add, congruence, diagonal, fractions, identity, scale
from systems import (Random, chain3, classical, exceptional_point, random_graded, random_plain, rounded, system)

PRECISIONS = (500, 700)  # bits after the point


# ---------------------------------------------------------------- matrix exponential in fixed point
def to_fixed(a, bits):
    return [[(x.numerator << bits) // x.denominator for x in row] for row in a]


def fixed_product(a, b, bits):
    columns = list(zip(*b))
    half = 1 << (bits - 1)
    return [[(sum(x * y for x, y in zip(row, column) if x and y) + half) >> bits for column in columns] for row in a]


def exponential(a, t, bits):
    """exp(a t) for a matrix of fractions, as integers over 2^bits."""
    size = max(sum(abs(x) for x in row) for row in a) * t
    squarings = max(0, (int(size) + 1).bit_length() + 8)
    guard = bits + 2 * squarings + 64
    step = to_fixed(scale(t / 2**squarings, a), guard)
    n = len(a)
    one = 1 << guard
    result = [[one * (i == j) for j in range(n)] for i in range(n)]
    term, k = result, 0
    while any(x for row in term for x in row):
        k += 1
        term = [[x // k for x in row] for row in fixed_product(term, step, guard)]
        result = [[x + y for x, y in zip(r, s)] for r, s in zip(result, term)]
        term = [[0 if x == -1 else x for x in row] for row in term]  # floor division leaves -1 for ever
    for _ in range(squarings):
        result = fixed_product(result, result, guard)
    return [[x >> (guard - bits) for x in row] for row in result]


def checked_exponential(a, t):
    """As fractions, after comparing two precisions."""
    low, high = ([[Fraction(x, 2**bits) for x in row] for row in exponential(a, t, bits)] for bits in PRECISIONS)
    largest = max(abs(x) for row in high for x in row)
    for r, s in zip(low, high):
        for x, y in zip(r, s):
            assert abs(x - y) <= largest / 10**40
            assert abs(x - y) <= max(abs(y) / 10**25, Fraction(1, 10**120))
    return high


# ---------------------------------------------------------------- the responses
def state_matrix(s):
    n = len(s["M"])
    inverse = exact.inverse(s["M"])
    lower = [[-x for x in k] + [-x for x in c] for k, c in zip(exact.multiply(inverse, s["K"]), exact.multiply(inverse, s["C"]))]
    upper = [[Fraction(0)] * n + row for row in identity(n)]
    return upper + lower, inverse


def times_vector(a, v):
    return [sum((x * y for x, y in zip(row, v)), Fraction(0)) for row in a]


def with_inputs(A, inverse, forces, generator):
    """[A B F; 0 G]: further states with x' = G x drive the system by the forces F (columns)."""
    n, k = len(inverse), len(forces)
    columns = [times_vector(inverse, f) for f in forces]
    top = [row + [Fraction(0)] * k if i < n else row + [c[i - n] for c in columns] for i, row in enumerate(A)]
    return top + [[Fraction(0)] * (2 * n) + [Fraction(x) for x in row] for row in generator]


def trajectory(times, states, n):
    value = lambda x: float(x) if abs(x) > Fraction(1, 10**100) else 0.0  # far above what the fixed point resolves
    return {"times": [float(t) for t in times], "position": [[value(x) for x in z[:n]] for z in states],
            "velocity": [[value(x) for x in z[n:2 * n]] for z in states]}


def column(a, j):
    return [row[j] for row in a]


def sampled_states(A, inverse, samples, h, times):
    """Exact propagation over each whole interval and into the one that holds t; the force is linear between samples."""
    n, zero = len(inverse), [Fraction(0)] * (2 * len(inverse))

    def advance(z, k, duration):
        slope = [(b - a) / h for a, b in zip(samples[k], samples[k + 1])]
        E = checked_exponential(with_inputs(A, inverse, [samples[k], slope], [[0, 0], [1, 0]]), duration)
        return times_vector(E, z + [Fraction(1), Fraction(0)])[:2 * n]

    at_samples = [zero]
    for k in range(len(samples) - 1):
        at_samples.append(advance(at_samples[-1], k, h))
    states = []
    for t in times:
        k = min(int(t / h), len(samples) - 2)
        states.append(advance(at_samples[k], k, t - k * h) if t != k * h else at_samples[k])
    return states


def taylor_reference(s, force, z0, t, rate, terms=90):
    """q, q' at t from the power series of q, stepped so that rate * step <= 2; force(t0, terms): coefficients about t0."""
    n = len(s["M"])
    with mp.workdps(70):
        matrix = lambda a: mp.matrix([[exact.fraction_to_mpf(x) for x in row] for row in a])
        inverse = matrix(s["M"]) ** -1
        C, K = inverse * matrix(s["C"]), inverse * matrix(s["K"])
        q, v = (mp.matrix([exact.fraction_to_mpf(x) for x in part]) for part in (z0[:n], z0[n:]))
        steps = int(rate * t / 2) + 1
        h = exact.fraction_to_mpf(t) / steps
        for step in range(steps):
            f = [inverse * c for c in force(step * h, terms)]
            c = [q, v]
            for k in range(terms):
                c.append((f[k] - (k + 1) * (C * c[k + 1]) - K * c[k]) / ((k + 1) * (k + 2)))
            q, v = mp.matrix(n, 1), mp.matrix(n, 1)
            for k in reversed(range(1, terms)):
                q, v = q * h + c[k], v * h + k * c[k]
            q = q * h + c[0]
        return list(q) + list(v)


def check_by_taylor(s, rate, force, z0, t, state):
    expected = taylor_reference(s, force, z0, t, rate)
    n = len(s["M"])
    for part in (slice(0, n), slice(n, 2 * n)):
        largest = max(abs(x) for x in expected[part])
        for x, y in zip(expected[part], state[part]):
            assert abs(x - exact.fraction_to_mpf(y)) <= largest * mpf(10) ** -35, s["name"]


def response_record(s, unit, frequency, seed, q0=None, v0=None, impulse=None):
    """unit: a time (s, a dyadic fraction) typical of the system."""
    n = len(s["M"])
    rng = Random(seed)
    vector = lambda: [Fraction(rng.integer(-64, 64), 64) for _ in range(n)]
    drawn = [vector() for _ in range(6)]
    q0, v0, impulse = q0 or drawn[0], v0 or drawn[1], impulse or drawn[2]
    force, cosine, sine = drawn[3:]
    A, inverse = state_matrix(s)
    zero, tiny = [Fraction(0)] * n, Fraction(1e-9)
    times = [Fraction(0), tiny] + [unit * x for x in (Fraction(1, 64), Fraction(1, 8), Fraction(1, 2), 1, 4, 32, 256)]
    times = [Fraction(float(t)) for t in times]
    w = Fraction(frequency)
    F = with_inputs(A, inverse, [force, cosine, sine], [[0, 0, 0], [0, 0, -w], [0, w, 0]])
    starts = {"free": q0 + v0, "impulse": zero + times_vector(inverse, impulse)}
    states = {"free": [], "impulse": [], "constant_force": [], "harmonic": []}
    for t in times:
        E = checked_exponential(F, t)
        Phi = [row[:2 * n] for row in E[:2 * n]]
        for key, z in starts.items():
            states[key].append(times_vector(Phi, z))
        states["constant_force"].append(column(E, 2 * n)[:2 * n])
        states["harmonic"].append(column(E, 2 * n + 1)[:2 * n])

    h = unit / 8
    samples = [vector() for _ in range(10)]
    inside = [h * x for x in (0, Fraction(1, 1024), Fraction(1, 2), 1, Fraction(7, 4), Fraction(19, 4), 8, 9)]
    states["sampled"] = sampled_states(A, inverse, samples, h, inside)

    rate = max(sum(abs(x) for x in row) for row in exact.multiply(inverse, s["K"])) ** Fraction(1, 2) + float(
        max(sum(abs(x) for x in row) for row in exact.multiply(inverse, s["C"]))) + float(w)
    mpv = lambda v: mp.matrix([exact.fraction_to_mpf(x) for x in v])
    nothing = lambda t0, terms: [mp.matrix(n, 1)] * terms
    constant = lambda t0, terms: [mpv(force)] + [mp.matrix(n, 1)] * (terms - 1)

    def rotating(t0, terms):
        x = exact.fraction_to_mpf(w)
        a, b = mp.cos(x * t0), mp.sin(x * t0)
        result = []
        for k in range(terms):
            result.append((a * mpv(cosine) + b * mpv(sine)) / mp.factorial(k))
            a, b = -x * b, x * a
        return result

    for key, forcing, z0 in (("free", nothing, starts["free"]), ("impulse", nothing, starts["impulse"]),
                             ("constant_force", constant, zero + zero), ("harmonic", rotating, zero + zero)):
        reachable = [i for i, t in enumerate(times) if t > tiny and (i == 2 or rate * t < 150)]
        for i in reachable[-1:] + reachable[:1]:
            check_by_taylor(s, rate, forcing, z0, times[i], states[key][i])
    if rate * h < 30:
        z = zero + zero
        for k in range(2):
            slope = [(b - a) / h for a, b in zip(samples[k], samples[k + 1])]
            ramp = lambda t0, terms: [mpv(samples[k]) + t0 * mpv(slope), mpv(slope)] + [mp.matrix(n, 1)] * (terms - 2)
            duration = h if k == 0 else Fraction(3, 4) * h
            z = [exact_fraction(x) for x in taylor_reference(s, ramp, z, duration, rate)]
        with mp.workdps(70):
            largest = max(abs(x) for x in z)
            assert all(abs(x - y) <= largest / 10**35 for x, y in zip(z, states["sampled"][4])), s["name"]

    floats = lambda v: [float(x) for x in v]
    record = {"name": s["name"], "n": n, "r": len(exact.null_space(s["K"]))}
    for key, name in (("M", "mass"), ("C", "damping"), ("K", "stiffness")):
        record[name] = [[float(x) for x in row] for row in rounded(s[key])]
    for key in ("jacobian", "task_stiffness", "task_damping"):
        if key in s:
            record[key] = [[float(x) for x in row] for row in s[key]]
    record["eigenvalues"] = [[exact.hi_lo(re), exact.hi_lo(im)] for re, im in exact.spectrum(s["M"], s["C"], s["K"])]
    record["free"] = {"initial_position": floats(q0), "initial_velocity": floats(v0), **trajectory(times, states["free"], n)}
    record["impulse"] = {"impulse": floats(impulse), **trajectory(times, states["impulse"], n)}
    record["constant_force"] = {"force": floats(force), **trajectory(times, states["constant_force"], n)}
    record["harmonic"] = {"cosine": floats(cosine), "sine": floats(sine), "frequency": float(w),
                          **trajectory(times, states["harmonic"], n)}
    record["sampled"] = {"step": float(h), "samples": [floats(x) for x in samples], **trajectory(inside, states["sampled"], n)}
    record["receptance"] = [receptance(s, x) for x in (w / 64, w, 16 * w)]
    return record


def exact_fraction(x):
    sign, mantissa, exponent, _ = x._mpf_
    return (-1) ** sign * int(mantissa) * Fraction(2) ** exponent


def receptance(s, w):
    """(K + i w C - w^2 M)^-1, exactly, as the inverse of the real matrix [A -B; B A]."""
    n = len(s["M"])
    A, B = add(s["K"], scale(-w * w, s["M"])), scale(w, s["C"])
    real = [a + [-x for x in b] for a, b in zip(A, B)] + [b + a for a, b in zip(A, B)]
    inverse = exact.inverse(real)
    return {"frequency": float(w), "real": [[float(x) for x in row[:n]] for row in inverse[:n]],
            "imag": [[float(x) for x in row[:n]] for row in inverse[n:]]}


# ---------------------------------------------------------------- the systems
def small(name, m, c, k):
    return system(name, "response", fractions(m), fractions(c), fractions(k))


def from_product(name, mass, J, K_C, C_C):
    """The truth is that of the exact products, which are not doubles."""
    M, J, K_C, C_C = fractions(mass), fractions(J), diagonal(K_C), diagonal(C_C)
    return dict(name=name, M=M, C=congruence(J, C_C), K=congruence(J, K_C), jacobian=J, task_stiffness=K_C, task_damping=C_C)


def baxter7():
    """The source paper's Table 4: seven joints, five task directions, two zero modes."""
    mass = [[3.414, -0.6947, -0.1556, -0.456, 1.934, -0.3131, 0.2101], [-0.6947, 8.71, 0.3832, 5.484, 0.127, 3.108, -0.08658],
            [-0.1556, 0.3832, 3.86, 0.1785, 1.995, 0.2056, 0.1165], [-0.456, 5.484, 0.1785, 4.831, 0.04439, 2.444, -0.07011],
            [1.934, 0.127, 1.995, 0.04439, 2.77, -0.01395, 0.2296], [-0.3131, 3.108, 0.2056, 2.444, -0.01395, 2.459, -0.07805],
            [0.2101, -0.08658, 0.1165, -0.07011, 0.2296, -0.07805, 0.08852]]
    J = [[-0.57, -0.128, -0.3816, -0.2208, -0.1616, -0.1613, 0.0], [0.57, -0.128, 0.3816, -0.2208, 0.1616, -0.1613, 0.0],
         [0.0, -0.7371, 0.0, -0.3903, 0.0, -0.02537, 0.0], [0.0, -0.7071, 0.6028, -0.7071, 0.693, -0.7071, 0.07818],
         [0.0, 0.7071, 0.6028, 0.7071, 0.693, 0.7071, 0.07818]]
    return from_product("baxter7", mass, J, [300, 200, 100, 10, 7], [3.5, 2.5, 2.5, 2, 1])


def renamed(s, name):
    return s | {"name": name}


def make_responses(folder):
    from make_oracle import write

    start = time.time()
    half = Fraction(1, 2)
    zero3 = [Fraction(0)] * 3
    cases = [
        (chain3(), Fraction(1, 4), 20, dict(q0=[Fraction(0), Fraction(0.03), Fraction(0)], v0=zero3,
                                            impulse=[Fraction(1), Fraction(0), Fraction(0)])),
        (baxter7(), Fraction(1), 3, dict(q0=[Fraction(0), Fraction(0.01), Fraction(0.01)] + [Fraction(0)] * 4,
                                         v0=[Fraction(0)] * 7)),
        (small("n1_underdamped", [[2]], [[half]], [[50]]), Fraction(1), 4, {}),
        (small("n1_critical", [[2]], [[20]], [[50]]), Fraction(1), 4, {}),
        (small("n1_nearly_critical_2^-30", [[1]], [[2 + Fraction(1, 2**30)]], [[1]]), Fraction(4), 1, {}),
        (small("n1_free_undamped", [[2]], [[0]], [[0]]), Fraction(1), 2, {}),
        (small("n1_free_damped", [[2]], [[3]], [[0]]), Fraction(1), 2, {}),
        (small("n2_overdamped", [[2, 1], [1, 3]], [[900, 200], [200, 700]], [[50, -20], [-20, 80]]), Fraction(2), 5, {}),
        (small("n2_undamped", [[2, 1], [1, 3]], [[0, 0], [0, 0]], [[50, -20], [-20, 80]]), Fraction(1), 4, {}),
        (small("n2_no_stiffness_damped", [[2, 1], [1, 3]], [[2, 1], [1, 1]], [[0, 0], [0, 0]]), Fraction(1), 4, {}),
        (small("n2_no_stiffness_undamped", [[2, 1], [1, 3]], [[0, 0], [0, 0]], [[0, 0], [0, 0]]), Fraction(1), 4, {}),
        (small("n2_stiff_1_and_1e4", [[1, 1], [1, 2]], [[half, half], [half, 100 + half]], [[1, 1], [1, 10**8 + 1]]), Fraction(4), 2, {}),
        (small("n2_zero_mode_coupled", [[1, 0], [0, 2]], [[1, -half], [-half, 2]], [[9, -9], [-9, 9]]), Fraction(2), 3, {}),
        (renamed(exceptional_point(11), "n4_exceptional_point"), Fraction(2), 2, {}),
        (renamed(classical(4, [0, half, 1, 4], 8, 6, "mixed", 4001, True), "n4_mixed_damping_one_critical"), Fraction(1, 2), 3, {}),
        (renamed(random_graded(4, 1, "ordinary", "joint", 4, 3, 4002), "n4_r1_coupled"), Fraction(1, 4), 6, {}),
        (renamed(random_plain(6, "ordinary", 4003), "n6_ordinary"), Fraction(1, 8), 30, {}),
        (renamed(random_graded(6, 2, "none", "none", 6, 4, 4004), "n6_r2_undamped"), Fraction(1, 4), 5, {}),
        (renamed(random_graded(7, 1, "light", "task", 4, 3, 4005), "n7_r1_zero_mode_undamped"), Fraction(1, 4), 7, {}),
        (renamed(random_graded(7, 2, "ordinary", "joint", 4, 4, 4006), "n7_r2_coupled"), Fraction(1, 4), 7, {}),
    ]
    records = []
    for i, (s, unit, frequency, given) in enumerate(cases):
        before = time.time()
        records.append(response_record(s, unit, frequency, 5000 + i, **given))
        sizes = [round(abs(complex(z[0][0], z[1][0])), 3) for z in records[-1]["eigenvalues"]]
        print(f"{s['name']}: r {records[-1]['r']}, |lambda| {sizes[0]} .. {sizes[-1]}, {time.time() - before:.1f} s", flush=True)
    note = ("Written by make_oracle.py. SI units. Responses of M q'' + C q' + K q = f, rounded to the nearest double; with a jacobian J "
            "the truth is that of K = J' task_stiffness J and C = J' task_damping J formed exactly. All but `free` start from rest; "
            "`sampled` is linear between samples.")
    write(os.path.join(folder, "responses.json"), "systems", note, records)
    print(f"responses: {time.time() - start:.0f} s")
