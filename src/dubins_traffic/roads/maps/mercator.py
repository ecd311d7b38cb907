"""Degrees of latitude and longitude to metres and back: the transverse Mercator projection of UTM, WGS 84.

Source: Krueger's series to the fourth order in the third flattening; see Karney, Transverse Mercator with an accuracy
of a few nanometers, 2011.
"""

from __future__ import annotations

from math import asinh, atan, atan2, atanh, cos, cosh, degrees, hypot, radians, sin, sinh, sqrt, tan

EQUATOR = 6378137.0
FLATTENING = 1.0 / 298.257223563
SHRUNK = 0.9996
"""Scale of the middle meridian of a zone."""
_N = FLATTENING / (2.0 - FLATTENING)
_E = sqrt(FLATTENING * (2.0 - FLATTENING))
_A = EQUATOR / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_THERE = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16 + 41 * _N**4 / 180,
    13 * _N**2 / 48 - 3 * _N**3 / 5 + 557 * _N**4 / 1440,
    61 * _N**3 / 240 - 103 * _N**4 / 140,
    49561 * _N**4 / 161280,
)
_BACK = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440,
    17 * _N**3 / 480 - 37 * _N**4 / 840,
    4397 * _N**4 / 161280,
)


def to_metres(latitude: float, longitude: float, meridian: float) -> tuple[float, float]:
    """Return (east, north) of a place in degrees: metres from the equator and a middle meridian (degrees)."""
    away = radians(longitude - meridian)
    tau = _conformal(tan(radians(latitude)))
    xi, eta = atan2(tau, cos(away)), asinh(sin(away) / hypot(tau, cos(away)))
    north, east = xi, eta
    for k, a in enumerate(_THERE, start=1):
        north += a * sin(2 * k * xi) * cosh(2 * k * eta)
        east += a * cos(2 * k * xi) * sinh(2 * k * eta)
    return SHRUNK * _A * east, SHRUNK * _A * north


def to_degrees(east: float, north: float, meridian: float) -> tuple[float, float]:
    """Return latitude and longitude of what `to_metres` maps to (east, north)."""
    xi, eta = north / (SHRUNK * _A), east / (SHRUNK * _A)
    inner_xi, inner_eta = xi, eta
    for k, b in enumerate(_BACK, start=1):
        inner_xi -= b * sin(2 * k * xi) * cosh(2 * k * eta)
        inner_eta -= b * cos(2 * k * xi) * sinh(2 * k * eta)
    wanted = sin(inner_xi) / hypot(sinh(inner_eta), cos(inner_xi))
    tau = wanted
    for _ in range(6):
        tau -= (_conformal(tau) - wanted) * _slope(tau)
    return degrees(atan(tau)), meridian + degrees(atan2(sinh(inner_eta), cos(inner_xi)))


def middle_meridian(longitude: float) -> float:
    """Return the middle meridian of the zone of UTM in which a longitude lies, degrees."""
    return 6.0 * ((longitude + 180.0) // 6.0) - 177.0


def _conformal(tau: float) -> float:
    """Return the tangent of the conformal latitude from that of the latitude."""
    sigma = sinh(_E * atanh(_E * tau / hypot(1.0, tau)))
    return tau * hypot(1.0, sigma) - sigma * hypot(1.0, tau)


def _slope(tau: float) -> float:
    """Return about how fast the latitude's tangent grows with the conformal latitude's."""
    return (1.0 + (1.0 - _E * _E) * tau * tau) / (
        (1.0 - _E * _E) * hypot(1.0, tau) * hypot(1.0, _conformal(tau))
    )
