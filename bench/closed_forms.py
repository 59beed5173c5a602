# SPDX-License-Identifier: Apache-2.0
"""Exact solutions that `fledge bench accuracy` holds the world against, in 40 decimal digits, so that
all of a difference is the world's.

Vectors are lists of mpf, matrices lists of rows. A double is taken as the number that it is.
"""
from decimal import Context, Decimal, localcontext
from math import factorial

from mpmath import mp, mpf

mp.dps = 40


# --- vectors and attitudes -------------------------------------------------------------------------

def vector(numbers):
    return [mpf(float(x)) for x in numbers]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b)), mpf(0))


def norm(a):
    return mp.sqrt(dot(a, a))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def add(a, b, factor=1):
    """a + factor b"""
    return [x + factor * y for x, y in zip(a, b)]


def scale(factor, a):
    return [factor * x for x in a]


def times(A, x):
    return [dot(row, x) for row in A]


def transpose(A):
    return [list(row) for row in zip(*A)]


def product(A, B):
    columns = transpose(B)
    return [[dot(row, column) for column in columns] for row in A]


def relative(a, b):
    """|a - b| / |b|"""
    return norm(add(a, b, -1)) / norm(b)


def identity():
    return [[mpf(i == j) for j in range(3)] for i in range(3)]


def dcm(sigma):
    """[BN] of sigma_BN: I + (8 t^2 - 4 (1 - s^2) t) / (1 + s^2)^2, t the matrix of the cross product."""
    s2 = dot(sigma, sigma)
    t = [[0, -sigma[2], sigma[1]], [sigma[2], 0, -sigma[0]], [-sigma[1], sigma[0], 0]]
    t2 = product(t, t)
    return [[(i == j) + (8 * t2[i][j] - 4 * (1 - s2) * t[i][j]) / (1 + s2)**2 for j in range(3)] for i in range(3)]


def rotation(turn):
    """The matrix that turns vectors by |turn| [rad] about `turn`: exp of its cross product."""
    angle = norm(turn)
    sigma = scale(mp.tan(angle / 4) / angle, turn) if angle else turn
    return transpose(dcm(sigma))


def angle_between(A, B):
    """The angle [rad] by which two attitudes differ."""
    difference = product(A, transpose(B))
    sine = norm([difference[i - 1][i - 2] - difference[i - 2][i - 1] for i in range(3)]) / 2
    return mp.atan2(sine, (difference[0][0] + difference[1][1] + difference[2][2] - 1) / 2)


# --- torque-free rotation --------------------------------------------------------------------------

class SymmetricTop:
    """A body with moments of inertia A, A, C. With H = A omega + (C - A) omega3 b3 the rate is H / A less a
    spin about b3, both constant:  [NB](t) = exp(H t / A) [NB](0) exp(-(C - A) omega3 t / A b3)."""

    def __init__(self, A, C, sigma_BN, omega_B):
        self.A, omega = mpf(A), vector(omega_B)
        self.NB = transpose(dcm(vector(sigma_BN)))
        self.H_N = times(self.NB, [A * omega[0], A * omega[1], C * omega[2]])
        self.spin = (C - self.A) * omega[2] / self.A

    def dcm_BN(self, t):
        ahead = product(rotation(scale(mpf(t) / self.A, self.H_N)), self.NB)
        return transpose(product(ahead, rotation([mpf(0), mpf(0), -self.spin * t])))


class Tumbler:
    """The rate of a body with moments of inertia I1 < I2 < I3 that starts with omega2 = 0, by Jacobi's
    elliptic functions. Source: Landau, Lifshitz, Mechanics, section 37; for H^2 > 2 T I2."""

    def __init__(self, inertia, omega_B):
        I1, I2, I3 = map(mpf, inertia)
        w1, w2, w3 = vector(omega_B)
        T2 = I1 * w1**2 + I3 * w3**2   # twice the energy
        H2 = (I1 * w1)**2 + (I3 * w3)**2
        if w2 != 0 or not (w1 > 0 and w3 > 0 and H2 > T2 * I2):
            raise ValueError("the solution is written for omega2 = 0, omega1, omega3 > 0 and H^2 > 2 T I2")
        self.amplitudes = [w1, mp.sqrt((T2 * I3 - H2) / (I2 * (I3 - I2))), w3]
        self.speed = mp.sqrt((I3 - I2) * (H2 - T2 * I1) / (I1 * I2 * I3))
        self.m = (I2 - I1) * (T2 * I3 - H2) / ((I3 - I2) * (H2 - T2 * I1))

    def omega_B(self, t):
        u = self.speed * t
        return [a * mp.ellipfun(kind, u, m=self.m) for kind, a in zip(("cn", "sn", "dn"), self.amplitudes)]


# --- orbits ----------------------------------------------------------------------------------------

def jet_damping(I, distance, flow, fuel, radius, t):
    """omega / omega_0 after t of a spin about an axis of symmetry, at whose `distance` jets along the axis expel `flow`
    [kg/s] of a ball of `fuel` of constant density on the axis, which has the radius at first: of
    I domega = flow (dI/dm - distance^2) omega dt."""
    def inertia(m):
        return I + mpf(2) / 5 * radius**2 * fuel * (m / fuel)**(mpf(5) / 3)

    left = fuel - flow * t
    return inertia(fuel) / inertia(left) * mp.exp(-distance**2 * mp.quad(lambda m: 1 / inertia(m), [left, fuel]))


def kepler(mu, r, v, t):
    """(r, v) after a time t > 0 about a point mass, but for near-parabolas, by the universal variable chi:

        sqrt(mu) t = (r.v / sqrt(mu)) chi^2 C + (1 - |r| / a) chi^3 S + |r| chi

    with Stumpff's functions C and S of chi^2 / a. Source: Battin, section 4.5.
    """
    mu, r, v, t = mpf(mu), vector(r), vector(v), mpf(t)
    r0, along, root = norm(r), dot(r, v) / mp.sqrt(mu), mp.sqrt(mu)
    alpha = 2 / r0 - dot(v, v) / mu    # 1 / a
    h = cross(r, v)
    p = dot(h, h) / mu
    periapsis = p / (1 + mp.sqrt(1 - alpha * p))

    def stumpff(z):
        if z > 0:
            return (1 - mp.cos(mp.sqrt(z))) / z, (mp.sqrt(z) - mp.sin(mp.sqrt(z))) / mp.sqrt(z)**3
        if z < 0:
            return (mp.cosh(mp.sqrt(-z)) - 1) / -z, (mp.sinh(mp.sqrt(-z)) - mp.sqrt(-z)) / mp.sqrt(-z)**3
        return mpf(1) / 2, mpf(1) / 6

    # The right side less the left rises with chi, at the rate of the distance: so its zero lies below
    # sqrt(mu) t / periapsis, and Newton's steps may be kept within what is left of that interval.
    lo, hi = mpf(0), root * t / periapsis
    chi = hi / 2
    while hi - lo > mpf(10)**-36 * hi:
        C, S = stumpff(alpha * chi**2)
        late = along * chi**2 * C + (1 - alpha * r0) * chi**3 * S + r0 * chi - root * t
        lo, hi = (chi, hi) if late < 0 else (lo, chi)
        distance = along * chi * (1 - alpha * chi**2 * S) + (1 - alpha * r0) * chi**2 * C + r0
        ahead = chi - late / distance
        if abs(ahead - chi) < mpf(10)**-36 * chi:
            break
        chi = ahead if lo < ahead < hi else (lo + hi) / 2
    C, S = stumpff(alpha * chi**2)
    f, g = 1 - chi**2 / r0 * C, t - chi**3 / root * S
    there = add(scale(f, r), v, g)
    r1 = norm(there)
    df, dg = root / (r1 * r0) * chi * (alpha * chi**2 * S - 1), 1 - chi**2 / r1 * C
    return there, add(scale(df, r), v, dg)


# --- gravity ---------------------------------------------------------------------------------------

def decimal(x):
    """A double or mpf as a Decimal."""
    return Decimal(mp.nstr(x, 40)) if isinstance(x, mpf) else Decimal(x)


class Harmonics:
    """A gravity field by its definition, in 60 digits: Legendre functions as they stand in textbooks, normalised
    by factorials, and the gradient by differences so small that they do not show.

        U = mu / r sum_nm (R / r)^n N_nm P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon)

    coefficients: {(n, m): (C, S)}, fully normalised, without (0, 0). Decimals, whose arithmetic is fast.
    """

    def __init__(self, mu, radius, coefficients, degree=None):
        self.mu, self.R = decimal(mu), decimal(radius)
        self.degree = degree or max(n for n, _ in coefficients)
        self.terms = [[] for _ in range(self.degree + 1)]    # by order: (n, N C, N S)
        with localcontext(Context(prec=60)):
            for (n, m), (C, S) in sorted(coefficients.items()):
                if n > self.degree:
                    continue
                N = Decimal((1 if m == 0 else 2) * (2 * n + 1) * factorial(n - m)) / factorial(n + m)
                self.terms[m].append((n, N.sqrt() * decimal(C), N.sqrt() * decimal(S)))

    def potential(self, r):
        """U [m^2/s^2] at Decimals off the poles."""
        x, y, z = r
        distance, across = (x * x + y * y + z * z).sqrt(), (x * x + y * y).sqrt()
        s, c = z / distance, across / distance
        cos1, sin1 = x / across, y / across
        powers = [(self.R / distance)**n for n in range(self.degree + 1)]
        cos_m, sin_m, P_mm = Decimal(1), Decimal(0), Decimal(1)
        total = Decimal(1)
        for m, terms in enumerate(self.terms):
            # (n - m) P_nm = (2n - 1) s P_n-1,m - (n + m - 1) P_n-2,m
            P = {m - 1: Decimal(0), m: P_mm}
            for n in range(m + 1, self.degree + 1):
                P[n] = ((2 * n - 1) * s * P[n - 1] - (n + m - 1) * P[n - 2]) / (n - m)
            total += sum((powers[n] * P[n] * (C * cos_m + S * sin_m) for n, C, S in terms), Decimal(0))
            cos_m, sin_m = cos_m * cos1 - sin_m * sin1, sin_m * cos1 + cos_m * sin1
            P_mm *= (2 * m + 1) * c
        return self.mu / distance * total

    def potential_at(self, r):
        """The same at a position [m] of mpf, as mpf."""
        with localcontext(Context(prec=60)):
            return mpf(str(self.potential([decimal(x) for x in r])))

    def gravity(self, r):
        """The gradient [m/s^2] at a position [m] of mpf, as mpf."""
        with localcontext(Context(prec=60)):
            r, h = [decimal(x) for x in r], Decimal("1e-9")
            gradient = []
            for i in range(3):
                ahead, behind = ([x + step * (i == j) for j, x in enumerate(r)] for step in (h, -h))
                gradient.append(mpf(str((self.potential(ahead) - self.potential(behind)) / (2 * h))))
            return gradient


def relativity(mu, r, v):
    """What general relativity adds at r, v around a mass: Schwarzschild's term in harmonic coordinates."""
    r, v, c2 = vector(r), vector(v), mpf(299792458)**2
    factor = mpf(mu) / (c2 * norm(r)**3)
    return add(scale(factor * (4 * mpf(mu) / norm(r) - dot(v, v)), r), v, factor * 4 * dot(r, v))


# --- ephemerides -----------------------------------------------------------------------------------

class Kernel:
    """The segments of a SPICE SPK kernel, which jplephem finds, summed exactly as Chebyshev polynomials."""

    def __init__(self, path):
        from jplephem.spk import SPK

        self.spk = SPK.open(str(path))
        self.segments = self.spk.segments

    def state(self, segment, t):
        """(r [m], v [m/s]) of a segment's target relative to its center at t [s] of TDB past J2000."""
        daf, t = self.spk.daf, mpf(t)
        begin, length, words, count = map(int, daf.read_array(segment.end_i - 3, segment.end_i))
        index = min(int((t - begin) / length), count - 1)
        first = segment.start_i + index * words
        middle, radius, *numbers = map(mpf, daf.read_array(first, first + words - 1).tolist())
        n = len(numbers) // (3 if segment.data_type == 2 else 6)
        s = (t - middle) / radius
        T, dT = [mpf(1), s], [mpf(0), mpf(1)]
        for _ in range(2, n):
            dT.append(2 * T[-1] + 2 * s * dT[-1] - dT[-2])
            T.append(2 * s * T[-1] - T[-2])
        parts = [numbers[i:i + n] for i in range(0, len(numbers), n)]
        r = [1000 * dot(T, part) for part in parts[:3]]
        if segment.data_type == 2:
            return r, [1000 * dot(dT, part) / radius for part in parts]
        return r, [1000 * dot(T, part) for part in parts[3:]]
