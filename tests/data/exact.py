"""Exact spectra of second-order systems given as doubles: integers and fractions only, plus mpmath for starting values.

The eigenvalues of lambda^2 M + lambda C + K are the roots of the integer polynomial
p(lambda) = det(lambda^2 M + lambda C + K), which is found exactly (fraction-free determinants at 2n + 1 integer points and
interpolation). Its zero roots, its factor with roots symmetric about the imaginary axis and its multiple roots are split off
exactly, by polynomial gcd; so defective eigenvalues, exact zeros and exactly imaginary eigenvalues are known as such, and only
simple roots are left. These come from the Ehrlich-Aberth iteration, and each is *proved*: p is evaluated at it in exact integer
arithmetic, and the disc of radius N |p(z_i)| / (|a_N| prod_j |z_i - z_j|) about z_i holds exactly one root when the discs are
disjoint (Smith 1970). Every disc is smaller than 2^-ACCURACY_BITS times the smaller of |Re|, |Im| (of those not exactly zero).
"""

from fractions import Fraction
from math import gcd

from mpmath import mp, mpc, mpf

ACCURACY_BITS = 116  # relative, per component: 1.2e-35
ROUND_BITS = 260     # an approximate root is kept with this many bits per component
PRIME = (1 << 61) - 1


# ---------------------------------------------------------------- matrices of fractions
def fractions(rows):
    return [[Fraction(x) for x in row] for row in rows]


def transpose(a):
    return [list(column) for column in zip(*a)]


def multiply(a, b):
    columns = transpose(b)
    return [[sum((x * y for x, y in zip(row, column)), Fraction(0)) for column in columns] for row in a]


def add(*terms):
    return [[sum(entries, Fraction(0)) for entries in zip(*rows)] for rows in zip(*terms)]


def scale(factor, a):
    return [[factor * x for x in row] for row in a]


def diagonal(values):
    return [[Fraction(v) if i == j else Fraction(0) for j in range(len(values))] for i, v in enumerate(values)]


def identity(n):
    return diagonal([1] * n)


def congruence(t, a):
    """t' a t."""
    return multiply(transpose(t), multiply(a, t))


def inverse(a):
    """Gauss-Jordan with fractions; a must be regular."""
    n = len(a)
    work = [list(map(Fraction, row)) + [Fraction(i == j) for j in range(n)] for i, row in enumerate(a)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if work[i][k] != 0)
        work[k], work[pivot] = work[pivot], work[k]
        work[k] = [x / work[k][k] for x in work[k]]
        for i in range(n):
            if i != k and work[i][k] != 0:
                factor = work[i][k]
                work[i] = [x - factor * y for x, y in zip(work[i], work[k])]
    return [row[n:] for row in work]


def null_space(a):
    """Basis of the null space, as a list of column vectors (fractions)."""
    rows, n = [list(map(Fraction, row)) for row in a], len(a[0])
    pivots, k = [], 0
    for j in range(n):
        pivot = next((i for i in range(k, len(rows)) if rows[i][j] != 0), None)
        if pivot is None:
            continue
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][j] for x in rows[k]]
        for i in range(len(rows)):
            if i != k and rows[i][j] != 0:
                factor = rows[i][j]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
        pivots.append(j)
        k += 1
    basis = []
    for j in (j for j in range(n) if j not in pivots):
        v = [Fraction(0)] * n
        v[j] = Fraction(1)
        for i, p in enumerate(pivots):
            v[p] = -rows[i][j]
        basis.append(v)
    return basis


def rank(a):
    return len(a[0]) - len(null_space(a)) if a else 0


def is_positive_definite(a):
    """Exact: all pivots of the elimination without exchanges are positive."""
    rows = [list(map(Fraction, row)) for row in a]
    for k in range(len(rows)):
        if rows[k][k] <= 0:
            return False
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / rows[k][k]
            if factor != 0:
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
    return True


def is_positive_semidefinite(a):
    """Exact: a zero pivot must come with a zero row."""
    rows = [list(map(Fraction, row)) for row in a]
    for k in range(len(rows)):
        if rows[k][k] < 0 or (rows[k][k] == 0 and any(rows[k][k:])):
            return False
        if rows[k][k] == 0:
            continue
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / rows[k][k]
            if factor != 0:
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
    return True


# ---------------------------------------------------------------- the characteristic polynomial
def determinant(a):
    """Bareiss: fraction-free, integers in and out."""
    a, sign, previous = [row[:] for row in a], 1, 1
    n = len(a)
    for k in range(n - 1):
        if a[k][k] == 0:
            swap = next((i for i in range(k + 1, n) if a[i][k] != 0), None)
            if swap is None:
                return 0
            a[k], a[swap], sign = a[swap], a[k], -sign
        pivot, top = a[k][k], a[k]
        for i in range(k + 1, n):
            row, factor = a[i], a[i][k]
            for j in range(k + 1, n):
                row[j] = (pivot * row[j] - factor * top[j]) // previous
        previous = pivot
    return sign * a[-1][-1]


def characteristic_polynomial(M, C, K):
    """Integer coefficients (constant term first) of det(x^2 M + x C + K), x = lambda / 2^s, and s."""
    n = len(M)
    size = lambda a: max(abs(x) for row in a for x in row)
    ratio = size(K) / size(M) if size(K) else (size(C) / size(M)) ** 2
    s = (ratio.numerator.bit_length() - ratio.denominator.bit_length()) // 2 if ratio else 0
    unit = Fraction(2) ** s
    M, C = scale(unit * unit, M), scale(unit, C)
    lcm = 1
    for a in (M, C, K):
        for row in a:
            for x in row:
                lcm = lcm * x.denominator // gcd(lcm, x.denominator)
    M, C, K = ([[int(x * lcm) for x in row] for row in a] for a in (M, C, K))
    content = 0
    for a in (M, C, K):
        for row in a:
            for x in row:
                content = gcd(content, x)
    M, C, K = ([[x // content for x in row] for row in a] for a in (M, C, K))
    values = []
    for t in range(-n, n + 1):
        values.append(determinant([[t * t * M[i][j] + t * C[i][j] + K[i][j] for j in range(n)] for i in range(n)]))
    return primitive(interpolate(values, -n)), s


def interpolate(values, first):
    """The integer polynomial with the given values at first, first + 1, ...: Newton's forward differences."""
    differences, row = [], list(values)
    while row:
        differences.append(row[0])
        row = [b - a for a, b in zip(row, row[1:])]
    result = [Fraction(0)]
    factorial = 1
    factorials = []
    for k in range(len(differences)):
        factorial *= max(k, 1)
        factorials.append(factorial)
    for k in reversed(range(len(differences))):  # Horner on sum_k difference_k / k! prod_{j<k} (x - first - j)
        shifted = [Fraction(0)] + result
        for i, c in enumerate(result):
            shifted[i] -= (first + k) * c
        result = shifted
        result[0] += Fraction(differences[k], factorials[k])
    while len(result) > 1 and result[-1] == 0:
        result.pop()
    assert all(c.denominator == 1 for c in result)
    return [int(c) for c in result]


# ---------------------------------------------------------------- integer polynomials, constant term first
def primitive(p):
    content = 0
    for c in p:
        content = gcd(content, c)
    if content == 0:
        return []
    if p[-1] < 0:
        content = -content
    return [c // content for c in p]


def derivative(p):
    return [k * c for k, c in enumerate(p)][1:]


def mirrored(p):
    return [-c if k % 2 else c for k, c in enumerate(p)]


def pseudo_remainder(a, b):
    a = a[:]
    while len(a) >= len(b):
        common = gcd(a[-1], b[-1])
        f, g, shift = b[-1] // common, a[-1] // common, len(a) - len(b)
        a = [f * c for c in a]
        for i, c in enumerate(b):
            a[i + shift] -= g * c
        while a and a[-1] == 0:
            a.pop()
    return a


def gcd_is_trivial(a, b):
    """Sufficient test: the gcd modulo a prime is constant."""
    if a[-1] % PRIME == 0 or b[-1] % PRIME == 0:
        return False
    a, b = [c % PRIME for c in a], [c % PRIME for c in b]
    while b:
        leading = pow(b[-1], -1, PRIME)
        while len(a) >= len(b):
            factor, shift = a[-1] * leading % PRIME, len(a) - len(b)
            for i, c in enumerate(b):
                a[i + shift] = (a[i + shift] - factor * c) % PRIME
            while a and a[-1] == 0:
                a.pop()
        a, b = b, a
    return len(a) == 1


def polynomial_gcd(a, b):
    a, b = primitive(a), primitive(b)
    if len(a) < len(b):
        a, b = b, a
    if a == b:
        return a
    if b and gcd_is_trivial(a, b):
        return [1]
    while b:
        a, b = b, primitive(pseudo_remainder(a, b))
    return a


def exact_quotient(a, b):
    a, result = [Fraction(c) for c in a], [Fraction(0)] * (len(a) - len(b) + 1)
    for shift in reversed(range(len(result))):
        factor = a[shift + len(b) - 1] / b[-1]
        result[shift] = factor
        for i, c in enumerate(b):
            a[shift + i] -= factor * c
    assert not any(a)
    common = 1
    for c in result:
        common = common * c.denominator // gcd(common, c.denominator)
    return primitive([int(c * common) for c in result])


def squarefree_factors(p):
    """Yun: [(factor, multiplicity)], each factor without multiple roots."""
    if len(p) < 2:
        return []
    factors, common, multiplicity = [], polynomial_gcd(p, derivative(p)), 1
    rest = exact_quotient(p, common)
    while len(rest) > 1:
        shared = polynomial_gcd(rest, common)
        factor = exact_quotient(rest, shared)
        if len(factor) > 1:
            factors.append((factor, multiplicity))
        rest, multiplicity = shared, multiplicity + 1
        common = exact_quotient(common, shared)
    return factors


# ---------------------------------------------------------------- simple roots
def starting_points(p):
    """Bini: moduli from the upper hull of (k, log2 |a_k|)."""
    points = [(k, abs(c).bit_length() + 0.0) for k, c in enumerate(p) if c]
    hull = []
    for q in points:
        while len(hull) > 1 and (hull[-1][1] - hull[-2][1]) * (q[0] - hull[-1][0]) <= (q[1] - hull[-1][1]) * (
                hull[-1][0] - hull[-2][0]):
            hull.pop()
        hull.append(q)
    starts = []
    for (k0, l0), (k1, l1) in zip(hull, hull[1:]):
        radius = mp.power(2, (mpf(l0) - mpf(l1)) / (k1 - k0))
        for j in range(k1 - k0):
            starts.append(radius * mp.expjpi(mpf(2 * j) / (k1 - k0) + mpf(k0) / len(p) + mpf(7) / 10))
    return starts


def aberth(p, z, target_bits, iterations):
    """Ehrlich-Aberth sweeps at the current precision, until the corrections are below 2^-target_bits or stop shrinking."""
    coefficients = [mpf(c) for c in reversed(p)]
    n = len(z)
    done, best, stalled = [False] * n, [mpf(1)] * n, [0] * n
    floor = mp.ldexp(1, -target_bits)
    for _ in range(iterations):
        if all(done):
            break
        for i in range(n):
            if done[i]:
                continue
            x = z[i]
            value, slope = mpc(0), mpc(0)
            for c in coefficients:
                slope = slope * x + value
                value = value * x + c
            if value == 0:
                done[i] = True
                continue
            repulsion = mpc(0)
            for j in range(n):
                if j != i:
                    repulsion += 1 / (x - z[j])
            step = 1 / (slope / value - repulsion)
            z[i] = x - step
            relative = abs(step) / abs(z[i]) if z[i] != 0 else mpf(1)
            stalled[i] = 0 if relative < best[i] else stalled[i] + 1
            best[i] = min(best[i], relative)
            done[i] = relative < floor or (stalled[i] > 6 and best[i] < mpf(2) ** -20)
    return z


def to_fraction(x):
    """An mpf as a fraction of ROUND_BITS bits."""
    sign, mantissa, exponent, bits = x._mpf_
    if bits > ROUND_BITS:
        mantissa, exponent = mantissa >> (bits - ROUND_BITS), exponent + bits - ROUND_BITS
    return (-1) ** sign * Fraction(int(mantissa)) * Fraction(2) ** exponent


def exact_modulus_squared(p, re, im):
    """|p(re + i im)|^2, exactly."""
    lowest = max(re.denominator, im.denominator)
    a, b = int(re * lowest), int(im * lowest)
    value_re, value_im, power = 0, 0, 1
    for c in reversed(p):
        value_re, value_im = value_re * a - value_im * b + c * power, value_re * b + value_im * a
        power *= lowest
    power //= lowest
    return Fraction(value_re * value_re + value_im * value_im, power * power)


def fraction_to_mpf(x):
    return mpf(x.numerator) / mpf(x.denominator)


def certify(p, roots):
    """Smith's discs; returns whether each is small enough and isolated."""
    n = len(roots)
    with mp.workprec(400):
        z = [mpc(fraction_to_mpf(re), fraction_to_mpf(im)) for re, im in roots]
        radii = []
        for i in range(n):
            product = mpf(abs(p[-1]))
            for j in range(n):
                if j != i:
                    product *= abs(z[i] - z[j])
            if product == 0:
                return False
            radius = n * mp.sqrt(fraction_to_mpf(exact_modulus_squared(p, *roots[i]))) / product
            radii.append(radius * (1 + mpf(2) ** -100))
        for i in range(n):
            smallest = min(abs(x) for x in (z[i].real, z[i].imag) if x != 0)
            if radii[i] > mp.ldexp(smallest, -ACCURACY_BITS):
                return False
            for j in range(i):
                if abs(z[i] - z[j]) <= 1.001 * (radii[i] + radii[j]):
                    return False
    return True


def simple_roots(p):
    """All roots of a real polynomial without multiple or zero roots: [(re, im)] as fractions, proved."""
    precision, z = 300, None
    while precision < 40000:
        with mp.workprec(precision):
            z = aberth(p, starting_points(p) if z is None else [mpc(x) for x in z], min(270, precision - 20), 400)
            upper, real = [], []
            for x in z:
                if abs(x.imag) < mp.ldexp(abs(x), -200):
                    real.append((to_fraction(x.real), Fraction(0)))
                elif x.imag > 0:
                    upper.append((to_fraction(x.real), to_fraction(x.imag)))
            roots = real + [(re, s * im) for re, im in upper for s in (1, -1)]
            if len(roots) == len(p) - 1 and all(re or im for re, im in roots) and certify(p, roots):
                return roots
        precision *= 2
    raise ArithmeticError("roots not proved")


def square_root(re, im):
    """Principal root of re + i im to ROUND_BITS bits in each component; exactly imaginary for a negative real."""
    with mp.workprec(4 * ROUND_BITS):
        if im == 0:
            root = to_fraction(mp.sqrt(fraction_to_mpf(abs(re))))
            return (root, Fraction(0)) if re > 0 else (Fraction(0), root)
        root = mp.sqrt(mpc(fraction_to_mpf(re), fraction_to_mpf(im)))
        return to_fraction(root.real), to_fraction(root.imag)


def roots_of(p):
    """All roots with multiplicity, as fractions (re, im) right to ACCURACY_BITS; exact zeros and axes are exact."""
    p, roots = list(p), []
    while p and p[0] == 0:
        p.pop(0)
        roots.append((Fraction(0), Fraction(0)))
    even = polynomial_gcd(p, mirrored(p)) if len(p) > 1 else [1]
    rest = exact_quotient(p, even)
    if len(even) > 1:  # the factor whose roots come as +-lambda: a polynomial in lambda^2
        assert not any(even[1::2])
        for factor, multiplicity in squarefree_factors(even[::2]):
            for re, im in simple_roots(factor):
                a, b = square_root(re, im)
                roots += [(a, b), (-a, -b)] * multiplicity
    for factor, multiplicity in squarefree_factors(rest):
        roots += simple_roots(factor) * multiplicity
    return roots


def spectrum(M, C, K):
    """All 2n eigenvalues as fractions (re, im), sorted by modulus, then real part, then imaginary part (+ before -)."""
    p, s = characteristic_polynomial(M, C, K)
    assert len(p) == 2 * len(M) + 1
    unit = Fraction(2) ** s
    eigenvalues = [(re * unit, im * unit) for re, im in roots_of(p)]
    assert len(eigenvalues) == 2 * len(M)
    conjugates = sorted((re, -im) for re, im in eigenvalues)
    assert conjugates == sorted(eigenvalues)
    return sorted(eigenvalues, key=lambda z: (float(z[0] ** 2 + z[1] ** 2), z[0], abs(z[1]), -z[1]))


def hi_lo(x):
    """Two doubles whose sum is x to about 106 bits."""
    hi = float(x)
    return [hi, float(x - Fraction(hi))]
