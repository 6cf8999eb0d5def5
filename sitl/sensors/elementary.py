"""Logarithm, sine and cosine for the output of the random generator, from sums, products, quotients and
bits.

Library functions differ in the last bit from machine to machine, and take one number at a time, not lanes.
Coefficients and error bounds (below one unit in the last place) are those of fdlibm (Sun Microsystems, 1993:
e_log.c, k_sin.c, k_cos.c).
"""

from __future__ import annotations

from math import pi

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import bits_of, float_from_bits

_TURN = 2.0 * pi / 4294967296.0  # rad, of one step of a word
_EIGHTH = 1 << 29
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROOT_HALF_BITS = 0x3FE6A09E00000000


@kernel
def logarithm(x: float) -> float:
    """The natural logarithm of a number between 1e-300 and 1e300."""
    bits = bits_of(x)
    exponent = (bits - _ROOT_HALF_BITS) >> 52
    f = float_from_bits(bits - (exponent << 52)) - 1.0  # in sqrt(1/2) - 1 ... sqrt(2) - 1
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    odd = z * (
        0.6666666666666735130
        + w * (0.2857142874366239149 + w * (0.1818357216161805012 + w * 0.1479819860511658591))
    )
    even = w * (0.3999999999940941908 + w * (0.2222219843214978396 + w * 0.1531383769920937332))
    half = 0.5 * f * f
    k = exponent * 1.0
    return k * _LN2_HIGH - ((half - (s * (half + odd + even) + k * _LN2_LOW)) - f)


@kernel
def cosine_sine(word: int) -> tuple[float, float]:
    """Cosine and sine of an angle of `word` times 2^-32 turns; a word has 32 bits."""
    quarter = (word + _EIGHTH) >> 30
    x = (word - (quarter << 30)) * _TURN  # within pi/4
    z = x * x
    sine = x + x * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z
                * (
                    2.75573137070700676789e-06
                    + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
                )
            )
        )
    )
    rest = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z
                * (
                    -2.75573143513906633035e-07
                    + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
                )
            )
        )
    )
    half = 0.5 * z
    top = 1.0 - half
    cosine = top + (((1.0 - top) - half) + z * rest)
    # selects one of the two, with its sign: the other is multiplied by 0
    own = (1 - (quarter & 1)) * (1 - (quarter & 2)) * 1.0
    other = (quarter & 1) * ((quarter & 2) - 1) * 1.0
    return own * cosine + other * sine, own * sine - other * cosine
