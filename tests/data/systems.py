"""The systems of spectra.json: seeded random ones and the hard families, as exact fractions that are doubles.

Every builder returns a dict: name, family, seed, exact (what the family promises survives in the stored doubles exactly), M, C, K,
and where there is one the stiffness factor W (K = W'W exactly) or the jacobian and task_stiffness (K = J' K_C J exactly).
"""

from fractions import Fraction
from itertools import product

from mpmath import mp, mpf

from exact import (add, congruence, diagonal, fractions, identity, inverse, is_positive_definite,
                   multiply, scale, transpose)


class Random:
    """SplitMix64: the same numbers in every version of Python."""

    def __init__(self, seed):
        self.state = seed

    def bits(self):
        self.state = (self.state + 0x9E3779B97F4A7C15) % 2**64
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
        return z ^ (z >> 31)

    def integer(self, low, high):
        return low + self.bits() % (high - low + 1)

    def choice(self, items):
        return items[self.bits() % len(items)]

    def real(self):
        """Uniform in [-1, 1), 53 bits."""
        return Fraction(self.bits() >> 11, 2**52) - 1

    def integer_matrix(self, rows, columns, size):
        return [[Fraction(self.integer(-size, size)) for _ in range(columns)] for _ in range(rows)]

    def real_matrix(self, rows, columns):
        return [[self.real() for _ in range(columns)] for _ in range(rows)]


def power_of_two(k):
    return Fraction(2) ** k


def is_double(x):
    return Fraction(float(x)) == x


def is_exact(a):
    return all(is_double(x) for row in a for x in row)


def rounded(a):
    """Nearest doubles of an exactly symmetric matrix: symmetric again."""
    return fractions([[float(x) for x in row] for row in a])


def system(name, family, M, C, K, seed=0, exact=True, **more):
    if exact:
        assert all(is_exact(a) for a in (M, C, K)), name
    else:
        M, C, K = rounded(M), rounded(C), rounded(K)
    return dict(name=name, family=family, seed=seed, exact=exact, M=M, C=C, K=K, **more)


# ---------------------------------------------------------------- random systems
DAMPING_LEVEL = {"very_light": (-22, -18), "light": (-7, -5), "ordinary": (-4, -2), "near_critical": (0, 0),
                 "overdamped": (2, 4), "heavy": (10, 10), "mixed": (-12, 8)}


def random_graded(n, r, damping, coupling, mass_bits, frequency_bits, seed):
    """M = S (G'G + n I) S, K = W'W with W = 2^shift diag(2^f) W0 S, S = diag(2^s): all small integers and powers of two.

    coupling: "task" damps only the stiffness's own directions (C U0 = 0), "joint" adds S D S (couples zero and nonzero modes),
    "classical" is a M + b K, "none" is C = 0.
    """
    rng = Random(seed)
    while True:
        S = diagonal([power_of_two(rng.integer(0, mass_bits // 2)) for _ in range(n)])
        G = rng.integer_matrix(n, n, 1)
        A = add(multiply(transpose(G), G), scale(n, identity(n)))
        M = congruence(S, A)
        m = n - r
        shift = rng.integer(-3, 5)
        f = sorted(rng.integer(0, frequency_bits) for _ in range(m))
        if m > 1 and frequency_bits:
            f[0], f[-1] = 0, frequency_bits
        W0 = [[Fraction(3 * (i == j) + rng.integer(-1, 1)) for j in range(n)] for i in range(m)]
        W = multiply(scale(power_of_two(shift), diagonal([power_of_two(k) for k in f])), multiply(W0, S)) if m else []
        K = multiply(transpose(W), W) if m else scale(0, identity(n))
        C = scale(0, identity(n))
        if damping != "none":
            low, high = DAMPING_LEVEL[damping]
            if coupling == "classical":
                b = power_of_two(rng.integer(low, high) + 1 - shift - frequency_bits // 2)
                a = power_of_two(rng.integer(low, high) + shift + frequency_bits // 2) if rng.integer(0, 1) else Fraction(0)
                C = add(scale(a, M), scale(b, K))
            if coupling in ("task", "joint") and m:
                weight = diagonal([rng.choice([1, 2, 3]) * power_of_two(k + shift + 2 + rng.integer(low, high)) for k in f])
                C = congruence(multiply(W0, S), weight)
            if coupling == "joint":
                level = rng.integer(low, high) + shift + frequency_bits // 2 + 2
                B = rng.integer_matrix(n, n, 1)
                friction = add(multiply(transpose(B), B), identity(n))
                C = add(C, scale(power_of_two(level), congruence(S, friction)))
        if is_exact(M) and is_exact(C) and is_exact(K):
            name = f"random_n{n}_r{r}_{damping}_{coupling}_{seed}"
            return system(name, "random_graded", M, C, K, seed, stiffness_factor=W)


def random_plain(n, damping, seed):
    """Ungraded, r = 0, ordinary doubles: Gram matrices of uniform ones, rounded."""
    rng = Random(seed)

    def gram():
        G = rng.real_matrix(n, n)
        return add(multiply(transpose(G), G), scale(Fraction(1, 8), identity(n)))

    low, high = DAMPING_LEVEL[damping]
    M, K, C = gram(), scale(1000, gram()), scale(64 * power_of_two(rng.integer(low, high)), gram())
    return system(f"random_n{n}_plain_{damping}_{seed}", "random_plain", M, C, K, seed, exact=False)


def random_systems():
    graded = [  # n, r, damping, coupling, mass bits, frequency bits
        (1, 0, "ordinary", "joint", 0, 0), (1, 1, "ordinary", "joint", 0, 0), (1, 1, "none", "none", 0, 0),
        (2, 0, "none", "none", 8, 10), (2, 1, "light", "task", 4, 0), (2, 1, "near_critical", "joint", 26, 0),
        (3, 0, "near_critical", "classical", 0, 4), (3, 3, "ordinary", "joint", 10, 0), (3, 1, "heavy", "joint", 4, 6),
        (4, 2, "mixed", "joint", 12, 10), (4, 0, "very_light", "task", 26, 20), (5, 1, "ordinary", "task", 26, 12),
        (5, 5, "none", "none", 26, 0), (6, 0, "ordinary", "joint", 0, 4), (6, 0, "heavy", "joint", 4, 6),
        (6, 1, "overdamped", "task", 8, 8), (6, 2, "mixed", "joint", 26, 20), (6, 0, "very_light", "classical", 6, 6),
        (7, 1, "ordinary", "task", 6, 6), (7, 2, "ordinary", "joint", 6, 6), (7, 1, "light", "joint", 26, 20),
        (7, 3, "overdamped", "joint", 4, 4), (7, 1, "heavy", "task", 8, 10), (7, 2, "none", "none", 12, 20),
        (8, 2, "near_critical", "task", 10, 8), (10, 4, "mixed", "joint", 20, 16), (12, 0, "mixed", "task", 26, 20),
        (12, 5, "light", "joint", 6, 6), (16, 3, "ordinary", "joint", 12, 10), (20, 0, "mixed", "joint", 26, 20),
        (20, 8, "overdamped", "task", 8, 8), (24, 24, "ordinary", "joint", 20, 0), (30, 5, "light", "task", 16, 20),
        (40, 0, "ordinary", "joint", 26, 20), (40, 10, "mixed", "joint", 12, 12),
    ]
    plain = [(2, "ordinary"), (4, "near_critical"), (6, "ordinary"), (6, "light"), (7, "overdamped"), (7, "ordinary"),
             (8, "very_light"), (12, "ordinary"), (16, "mixed"), (24, "light"), (30, "near_critical")]
    builders = [lambda i=i, g=g: random_graded(*g, seed=1000 + i) for i, g in enumerate(graded)]
    builders += [lambda i=i, p=p: random_plain(*p, seed=2000 + i) for i, p in enumerate(plain)]
    return builders


# ---------------------------------------------------------------- helpers of the hard families
def real_fraction(x, bits=53):
    """An mpmath number rounded to a multiple of 2^-bits."""
    return Fraction(int(mp.nint(mp.ldexp(x, bits))), 2**bits)


def reflector(n):
    """Orthogonal with dyadic entries: I - 2 v v' / v'v with v'v a power of two."""
    v = {2: (1, 1), 3: (1, 1, 0), 4: (1, 1, 1, 1), 5: (2, 1, 1, 1, 1), 6: (4, 3, 2, 1, 1, 1), 7: (2, 2, 2, 1, 1, 1, 1),
         8: (1,) * 8}[n]
    total = sum(x * x for x in v)
    return [[Fraction(int(i == j)) - Fraction(2 * v[i] * v[j], total) for j in range(n)] for i in range(n)]


def unimodular(n, seed, size=1):
    """Integer matrix of determinant 1: unit lower times unit upper triangular."""
    rng = Random(seed)
    L = [[Fraction(1 if i == j else rng.integer(-size, size) if j < i else 0) for j in range(n)] for i in range(n)]
    U = [[Fraction(1 if i == j else rng.integer(-size, size) if j > i else 0) for j in range(n)] for i in range(n)]
    return multiply(L, U)


def cayley(skew):
    n = len(skew)
    return multiply(add(identity(n), scale(-1, skew)), inverse(add(identity(n), skew)))


def skew_matrix(rng, n, denominator):
    S = [[Fraction(0)] * n for _ in range(n)]
    for i in range(n):
        for j in range(i):
            S[i][j] = Fraction(rng.integer(-4, 4), denominator)
            S[j][i] = -S[i][j]
    return S


def block_diagonal(*blocks):
    n = sum(len(b) for b in blocks)
    result, offset = [[Fraction(0)] * n for _ in range(n)], 0
    for b in blocks:
        for i, row in enumerate(b):
            for j, x in enumerate(row):
                result[offset + i][offset + j] = Fraction(x)
        offset += len(b)
    return result


# ---------------------------------------------------------------- NLEVP
def spring(n, kappa, tau, label, exact=True):
    """M = I, C = tau T, K = kappa T with T = tridiag(-1, 3, -1)."""
    T = [[Fraction({0: 3, 1: -1}.get(abs(i - j), 0)) for j in range(n)] for i in range(n)]
    return system(f"spring_n{n}_{label}", "spring", identity(n), scale(tau, T), scale(kappa, T), exact=exact)


def spring_nearly_critical(n, mode):
    """tau = 2 sqrt(kappa / mu_mode), mu_j = 3 - 2 cos(j pi / (n + 1)): critical but for rounding."""
    mu = 3 - 2 * mp.cos(mode * mp.pi / (n + 1))
    return spring(n, Fraction(5), Fraction(float(2 * mp.sqrt(5 / mu))), f"mode{mode}_nearly_critical", exact=False)


def sleeper(n):
    """M = I, C = I + T^2, K = I + T + T^2 with T the circulant (1, -2, 1)."""
    T = [[Fraction({0: -2, 1: 1, n - 1: 1}.get(abs(i - j), 0)) for j in range(n)] for i in range(n)]
    C = add(identity(n), multiply(T, T))
    return system(f"sleeper_n{n}", "sleeper", identity(n), C, add(C, T))


def gen_hyper2(n, seed):
    """Hyperbolic, with real eigenvalues prescribed: E1 > E2, X = [V, V U], V and U orthogonal."""
    rng = Random(seed)
    E1 = diagonal([Fraction(-(k + 1), 2) for k in range(n)])
    E2 = diagonal([Fraction(-(n + (k + 1) ** 2)) for k in range(n)])
    V1 = cayley(skew_matrix(rng, n, 4))
    V2 = multiply(V1, cayley(skew_matrix(rng, n, 4)))

    def moment(k):
        term = lambda V, E: multiply(multiply(V, diagonal([E[i][i] ** k for i in range(n)])), transpose(V))
        return add(term(V1, E1), scale(-1, term(V2, E2)))

    M = inverse(moment(1))
    C = scale(-1, congruence(M, moment(2)))
    K = add(scale(-1, congruence(M, moment(3))), congruence(C, moment(1)))
    return system(f"gen_hyper2_n{n}", "gen_hyper2", M, C, K, seed, exact=False)


def damped_beam(n):
    """Simply supported Euler beam of n/2 Hermite elements with one damper at midspan (width 0.05, height 0.005, length 1)."""
    elements = n // 2
    h = Fraction(1, elements)
    area, second_moment = Fraction(5, 100) * Fraction(5, 1000), Fraction(5, 100) * Fraction(5, 1000) ** 3 / 12
    stiffness = 7 * Fraction(10) ** 10 * second_moment / h**3
    mass = Fraction(674, 1000) / area * area * h / 420
    ke = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
          [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    me = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
          [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    size = 2 * (elements + 1)
    K, M = [[Fraction(0)] * size for _ in range(size)], [[Fraction(0)] * size for _ in range(size)]
    for e in range(elements):
        for i, j in product(range(4), repeat=2):
            K[2 * e + i][2 * e + j] += stiffness * ke[i][j]
            M[2 * e + i][2 * e + j] += mass * me[i][j]
    keep = [i for i in range(size) if i not in (0, size - 2)]  # the two end displacements
    M, K = ([[a[i][j] for j in keep] for i in keep] for a in (M, K))
    C = diagonal([5 if keep[i] == (elements // 2) * 2 else 0 for i in range(n)])
    return system(f"damped_beam_n{n}", "damped_beam", M, C, K, exact=False)


# ---------------------------------------------------------------- prescribed modes
def classical(n, zetas, mass_bits, frequency_bits, label, seed, exact):
    """M = L L', C = L U diag(2 zeta omega) U'L', K = L U diag(omega^2) U'L'."""
    rng = Random(seed)
    s = [rng.integer(0, mass_bits // 2) for _ in range(n)]
    s[0], s[-1] = 0, mass_bits // 2
    L = [[power_of_two(s[i]) * (1 if i == j else rng.integer(-1, 1) if j < i else 0) for j in range(n)] for i in range(n)]
    omega = [power_of_two((frequency_bits * k) // max(n - 1, 1)) * (1 if exact else Fraction(rng.integer(8, 15), 8))
             for k in range(n)]
    if not exact:
        L = multiply(L, cayley(skew_matrix(rng, n, 8)))
    B = transpose(multiply(L, reflector(n)))
    zetas = [Fraction(z) for z in zetas]
    C = congruence(B, diagonal([2 * z * w for z, w in zip(zetas, omega)]))
    K = congruence(B, diagonal([w * w for w in omega]))
    family = "classical_exact" if exact else "classical"
    return system(f"{family}_n{n}_{label}", family, multiply(L, transpose(L)), C, K, seed, exact=exact,
                  prescribed_damping_ratios=[float(z) for z in zetas])


def nonclassical(n, seed):
    """U = R (I + i Theta), X = [U conj U]: M = (X Lambda X')^-1, C = -M X Lambda^2 X' M, K = -M X Lambda^3 X' M + C M^-1 C."""
    rng = Random(seed)
    while True:
        values = []
        for k in range(n):
            frequency = Fraction(rng.integer(64, 96) << k % 3, 32)
            values.append((-frequency * Fraction(rng.integer(16, 48), 64), frequency))
        R = add(identity(n), scale(Fraction(1, 8), rng.integer_matrix(n, n, 3)))
        Theta = scale(-1, cayley(skew_matrix(rng, n, 32 * n)))

        def moment(k):
            """2 Re[(I + i Theta) Lambda^k (I + i Theta)'] between R and R'."""
            powers = []
            for a, b in values:
                x, y = Fraction(1), Fraction(0)
                for _ in range(k):
                    x, y = x * a - y * b, x * b + y * a
                powers.append((x, y))
            X, Y = diagonal([p[0] for p in powers]), diagonal([p[1] for p in powers])
            YT = multiply(Theta, Y)
            inner = add(X, scale(-1, multiply(Theta, multiply(X, transpose(Theta)))), scale(-1, YT), scale(-1, transpose(YT)))
            return scale(2, multiply(R, multiply(inner, transpose(R))))

        M = inverse(moment(1))
        C = scale(-1, congruence(M, moment(2)))
        K = add(scale(-1, congruence(M, moment(3))), congruence(C, moment(1)))
        if is_positive_definite(M) and is_positive_definite(C) and is_positive_definite(K):
            return system(f"nonclassical_n{n}_{seed}", "nonclassical", M, C, K, seed, exact=False)


# ---------------------------------------------------------------- coalescing modes
EXCEPTIONAL_C, EXCEPTIONAL_K = [[3, 1], [1, 1]], [[Fraction(9, 2), 3], [3, Fraction(13, 2)]]
# det = ((x^2 + 2 x + 11/2) + x - 1) (... - x + 1) - (x + 3)^2 = (x^2 + 2 x + 9/2)^2: one double pair -1 +- i sqrt(7/2)


def exceptional_point(seed, perturbation=None):
    """A 2-dof system at its exceptional point beside two plain oscillators, mixed by an integer congruence."""
    T = unimodular(4, seed)
    K2 = [row[:] for row in EXCEPTIONAL_K]
    label = "exact"
    if perturbation is not None:
        K2[0][0] += power_of_two(perturbation)
        label = f"off_by_2^{perturbation}"
    M, C = identity(4), block_diagonal(EXCEPTIONAL_C, [[Fraction(1, 4)]], [[6]])
    K = block_diagonal(K2, [[Fraction(45, 2)]], [[5]])
    return system(f"exceptional_point_n4_{label}_{seed}", "exceptional_point", *(congruence(T, a) for a in (M, C, K)), seed)


def critical_in_nonclassical(seed):
    """A defective real eigenvalue in a 2-dof system whose damping is not classical, beside two others, mixed.

    Searched: small integers with p(-2) = p'(-2) = 0 for p = (x^2 + c1 x + k1)(x^2 + c2 x + k2) - (d x + e)^2, other roots complex.
    """
    for c1, c2, k1, k2, d, e in product(range(1, 9), range(1, 9), range(1, 20), range(1, 20), range(1, 4), range(-4, 5)):
        if c1 * c2 <= d * d or k1 * k2 <= e * e:
            continue
        p = [k1 * k2 - e * e, c1 * k2 + c2 * k1 - 2 * d * e, k1 + k2 + c1 * c2 - d * d, c1 + c2, 1]
        if sum(c * (-2) ** k for k, c in enumerate(p)) or sum(k * c * (-2) ** (k - 1) for k, c in enumerate(p) if k):
            continue
        a, b = p[3] - 4, p[0] // 4  # p = (x + 2)^2 (x^2 + a x + b)
        commutes = (c1 - c2) * e == (k1 - k2) * d
        if a * a < 4 * b and a > 0 and not commutes:
            break
    T = unimodular(4, seed)
    C, K = block_diagonal([[c1, d], [d, c2]], [[1]], [[9]]), block_diagonal([[k1, e], [e, k2]], [[30]], [[4]])
    return system(f"critical_in_nonclassical_n4_{seed}", "exceptional_point",
                  *(congruence(T, a) for a in (identity(4), C, K)), seed)


def coinciding(seed, gap_bits=None):
    """Two equal oscillators (semisimple double pair), or a pair 2^-gap_bits apart in omega^2, and two others, mixed."""
    T = unimodular(4, seed)
    gap = power_of_two(-gap_bits) if gap_bits else Fraction(0)
    C, K = diagonal([1, 1, Fraction(1, 2), 7]), diagonal([10, 10 + gap, 3, 9])
    name = f"nearly_coinciding_n4_2^-{gap_bits}" if gap_bits else f"coinciding_n4_{seed}"
    return system(name, "coinciding", *(congruence(T, a) for a in (identity(4), C, K)), seed)


def coinciding_undamped(seed):
    T = unimodular(4, seed)
    K = diagonal([4, 4, 4, 25])
    return system(f"coinciding_undamped_n4_{seed}", "coinciding", congruence(T, identity(4)), scale(0, identity(4)),
                  congruence(T, K), seed)


def veering(damping, seed):
    """Two oscillators 2^-20 apart, coupled by 2^-20, and one more; damping differs within the pair by 2^-damping."""
    e = power_of_two(-20)
    T = unimodular(3, seed)
    C = diagonal([Fraction(1, 8), Fraction(1, 8) + power_of_two(-damping), 1]) if damping else scale(0, identity(3))
    K = block_diagonal([[1, e], [e, 1 + e]], [[7]])
    return system(f"veering_n3_damping{damping}", "veering", *(congruence(T, a) for a in (identity(3), C, K)), seed)


# ---------------------------------------------------------------- a redundant arm
def planar_arm(bend_bits, friction, angle_bits=0):
    """Four links of a planar arm, each joint bent by 2^-bend_bits (None: stretched, J loses rank), tip stiffness diag(300, 200).

    J and M are rounded to few enough bits that J' K_C J and J' C_C J are exact in doubles.
    """
    links, masses = [Fraction(1, 2), Fraction(3, 8), Fraction(1, 4), Fraction(1, 8)], [4, 3, 2, 1]
    bend = mpf(0) if bend_bits is None else mp.ldexp(1, -bend_bits)
    angles = [bend * (i + 1) for i in range(4)]
    points = []  # joint and tip positions
    x, y = mpf(0), mpf(0)
    for length, angle in zip(links, angles):
        points.append((x, y))
        length = mpf(length.numerator) / length.denominator
        x, y = x + length * mp.cos(angle), y + length * mp.sin(angle)
    points.append((x, y))
    J = [[real_fraction(points[i][1] - y, 20) for i in range(4)], [real_fraction(x - points[i][0], 20) for i in range(4)]]
    M = [[Fraction(0)] * 4 for _ in range(4)]
    for link in range(4):  # a point mass at the end of each link, and a rotor at each joint
        px, py = points[link + 1]
        for i, j in product(range(link + 1), repeat=2):
            arms = (px - points[i][0]) * (px - points[j][0]) + (py - points[i][1]) * (py - points[j][1])
            M[i][j] += masses[link] * real_fraction(arms, 24)
    M = add(M, scale(Fraction(1, 16), identity(4)))
    K_C, C_C = diagonal([300, 200]), diagonal([20, 12])
    K, C = congruence(J, K_C), congruence(J, C_C)
    if friction:
        C = add(C, diagonal([Fraction(1, 2), Fraction(1, 4), Fraction(1, 8), Fraction(1, 8)]))
    label = "stretched" if bend_bits is None else f"bent_2^-{bend_bits}"
    return system(f"planar_arm_{label}_{'friction' if friction else 'task_damping'}", "redundant_arm", M, C, K,
                  jacobian=J, task_stiffness=K_C, task_damping=C_C)


def chain3():
    """Three masses on a line, free to drift (the source paper's Figure 2)."""
    return system("chain3", "paper", diagonal([8, 2, 5]), fractions([[25, -15, -10], [-15, 35, -20], [-10, -20, 30]]),
                  fractions([[3600, -1200, -2400], [-1200, 2700, -1500], [-2400, -1500, 3900]]))


def hard_families():
    builders = [lambda n=n: spring(n, 5, 10, "default") for n in (2, 5, 10, 20)]
    builders += [lambda: spring(2, 8, 4, "mode1_critical"), lambda: spring(5, 8, 4, "mode2_critical"),
                 lambda: spring(20, 8, 4, "mode7_critical"), lambda: spring_nearly_critical(5, 2),
                 lambda: spring_nearly_critical(10, 3), lambda: spring_nearly_critical(20, 11)]
    builders += [lambda: sleeper(6), lambda: gen_hyper2(5, 1), lambda: damped_beam(6), lambda: damped_beam(8)]

    near = {f"1-2^-{k}": 1 - power_of_two(-k) for k in (7, 13, 24)} | {f"1+2^-{k}": 1 + power_of_two(-k) for k in (7, 13, 24)}
    decimal = {f"1-1e-{k}": 1 - Fraction(10) ** -k for k in (2, 4, 8, 12)} | {
        f"1+1e-{k}": 1 + Fraction(10) ** -k for k in (2, 4, 8, 12)} | {
        "0": Fraction(0), "1e-12": Fraction(10) ** -12, "0.7": Fraction(7, 10), "1": Fraction(1), "1e3": Fraction(1000)}
    for i, (label, z) in enumerate(decimal.items()):
        n = 4 + i % 5
        builders.append(lambda n=n, z=z, label=label, i=i: classical(n, [z] * n, 26, 20, f"zeta_{label}", 3000 + i, False))
        builders.append(lambda z=z, label=label, i=i: classical(4, [z] * 4, 0, 3, f"ungraded_zeta_{label}", 3100 + i, False))
    exact_cases = near | {"0": Fraction(0), "1": Fraction(1), "2^-40": power_of_two(-40), "2^10": power_of_two(10)}
    for i, (label, z) in enumerate(exact_cases.items()):
        builders.append(lambda z=z, label=label, i=i: classical(4 + i % 5, [z] * (4 + i % 5), 26, 12 if "24" in label else 20,
                                                               f"zeta_{label}", 3200 + i, True))
    builders.append(lambda: classical(5, [0, Fraction(1, 16), 1, 1, 64], 26, 18, "mixed", 3300, True))
    builders.append(lambda: classical(8, [0, 0, Fraction(1, 16), Fraction(1, 2), 1, 1, 2, 64], 26, 18, "mixed", 3301, True))
    builders.append(lambda: classical(6, [Fraction(7, 10), 1, Fraction(1, 1000), 30, Fraction(9, 10), 1], 26, 20, "mixed", 3302, False))

    builders += [lambda: nonclassical(4, 1), lambda: nonclassical(8, 2)]
    builders += [lambda: exceptional_point(11), lambda: exceptional_point(12), lambda: exceptional_point(11, -20),
                 lambda: exceptional_point(11, -40), lambda: critical_in_nonclassical(13), lambda: coinciding(14),
                 lambda: coinciding(14, 33), lambda: coinciding_undamped(15)]
    builders += [lambda: veering(0, 16), lambda: veering(21, 17), lambda: veering(20, 18), lambda: veering(10, 19)]
    builders += [lambda b=b, f=f: planar_arm(b, f) for b in (2, 6, 10, 15, None) for f in (False, True)]
    builders.append(chain3)
    return builders
