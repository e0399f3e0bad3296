#!/usr/bin/env python3
"""Prints the coefficient tables of spirv_interp/ir/lower_math_f64.cpp (needs mpmath).

Each function is interpolated at Chebyshev nodes (none of them 0) in 60 digits and the coefficients are rounded to double; the
error printed is that of the rounded polynomial, relative to the whole function.
"""
from mpmath import mp, mpf, cos, cosh, sin, sinh, tanh, asin, asinh, acosh, atan, atanh, exp, log, pi, sqrt, matrix, lu_solve

mp.dps = 60


def half_odd(f, c=1):  # (f(x) - c x) / x^3 of z = x^2
    return lambda z: (f(sqrt(z)) - c * sqrt(z)) / sqrt(z) ** 3


def odd_error(f):
    return lambda z, p: (sqrt(z) + sqrt(z) * z * p) / f(sqrt(z)) - 1


TABLES = [
    # name, terms, from, to, function, relative error of the whole for a value p of the polynomial
    ("kExp2", 12, -0.5, 0.5, lambda r: (2**r - 1) / r, lambda r, p: (1 + r * p) / 2**r - 1),
    ("kExp", 10, -0.3466, 0.3466, lambda r: (exp(r) - 1 - r) / r**2, lambda r, p: (1 + r + r * r * p) / exp(r) - 1),
    ("kLog", 8, 0, 0.02944, lambda z: (log((1 + sqrt(z)) / (1 - sqrt(z))) / sqrt(z) - 2) / z,
     lambda z, p: (2 + z * p) * sqrt(z) / log((1 + sqrt(z)) / (1 - sqrt(z))) - 1),
    # without its first term, 2/(3 ln2)
    ("kLogAtanh", 8, 0, 0.02944, lambda z: 2 / log(mpf(2)) * ((atanh(sqrt(z)) - sqrt(z)) / sqrt(z) ** 3 - mpf(1) / 3) / z,
     lambda z, p: (sqrt(z) + (p * z * log(mpf(2)) / 2 + mpf(1) / 3) * sqrt(z) ** 3) / atanh(sqrt(z)) - 1),
    ("kSin", 7, 0, 0.62, half_odd(sin), odd_error(sin)),
    ("kCos", 7, 0, 0.62, lambda z: (cos(sqrt(z)) - 1 + z / 2) / z**2,
     lambda z, p: (1 - z / 2 + z * z * p) / cos(sqrt(z)) - 1),
    ("kAsin", 13, 0, 0.25, half_odd(asin), odd_error(asin)),
    ("kAtan", 12, 0, 0.1716, half_odd(atan), odd_error(atan)),
    ("kSinh", 8, 0, 1, half_odd(sinh), odd_error(sinh)),
    ("kTanh", 12, 0, 0.3907, half_odd(tanh), odd_error(tanh)),
    ("kAsinh", 13, 0, 0.25, half_odd(asinh), odd_error(asinh)),
    ("kAcosh", 14, 0, 0.5, lambda t: acosh(1 + t) / sqrt(2 * t), lambda t, p: p / (acosh(1 + t) / sqrt(2 * t)) - 1),
    ("kAtanh", 14, 0, 0.25, half_odd(atanh), odd_error(atanh)),
]


def fit(f, n, a, b):
    nodes = [(mpf(a) + b) / 2 + (mpf(b) - a) / 2 * cos(pi * (2 * k + 1) / (2 * n)) for k in range(n)]
    rows = matrix(n, n)
    values = matrix(n, 1)
    for i, x in enumerate(nodes):
        values[i] = f(x)
        for k in range(n):
            rows[i, k] = x**k
    solution = lu_solve(rows, values)
    return [float(solution[k]) for k in range(n)]


for name, n, a, b, f, error in TABLES:
    c = fit(f, n, a, b)
    worst = mpf(0)
    for k in range(400):
        x = mpf(a) + (mpf(b) - a) * (mpf(k) + mpf("0.37")) / 400
        p = mpf(0)
        for q in reversed(c):
            p = p * x + mpf(q)
        worst = max(worst, abs(error(x, p)))
    print("// error 2^%.1f of the function" % float(log(worst, 2)))
    print("constexpr double %s[] = {%s};" % (name, ", ".join(x.hex() for x in c)))

print()
for name, x in [("kLn2", log(mpf(2))), ("kLog2E", 1 / log(mpf(2))), ("kTwoLog2E", 2 / log(mpf(2))), ("kLogAtanhFirst", 2 / log(mpf(2)) / 3),
                ("kHalfPi", pi / 2), ("kTwoOverPi", 2 / pi)]:
    parts = []
    for _ in range(3):
        parts.append(float(x))
        x -= mpf(parts[-1])
    print(name, [p.hex() for p in parts])

mp.prec = 1400
print("2/pi", ["0x%08x" % (int((2 / pi) * mpf(2) ** (32 * (k + 1))) & 0xFFFFFFFF) for k in range(40)])
