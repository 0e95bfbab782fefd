"""The car's springs: how much of the ground's motion reaches the body, and how air keeps it at its height."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class QuarterCar:
    """One mode of the body on its wheels: the body's frequency (Hz) and damping ratio, and the wheels'.

    ``mass_ratio`` is unsprung over sprung mass, ``tyre_hz`` the sprung mass's frequency on the tyres alone.
    """

    body_hz: float
    damping: float
    mass_ratio: float = 0.09
    tyre_hz: float = 3.4

    def transfer(self) -> tuple[Array, Array]:
        """Numerator and denominator in s of body over road: two masses, a spring and damper, a tyre's spring.

        x_s / z = k_t (c s + k) / ((m_s s^2 + c s + k)(m_u s^2 + c s + k + k_t) - (c s + k)^2), for m_s = 1.
        """
        k = (2 * np.pi * self.body_hz) ** 2
        c = 2 * self.damping * 2 * np.pi * self.body_hz
        tyre = (2 * np.pi * self.tyre_hz) ** 2
        spring = np.array([c, k])
        body, wheel = np.array([1.0, c, k]), np.array([self.mass_ratio, c, k + tyre])
        return tyre * spring, np.polysub(np.polymul(body, wheel), np.polymul(spring, spring))


HEAVE = QuarterCar(body_hz=1.3, damping=0.35)
PITCH = QuarterCar(body_hz=1.5, damping=0.35)
ROLL = QuarterCar(body_hz=1.4, damping=0.40)


def sprung(ground: Array, mode: QuarterCar, step_s: float) -> Array:
    """The body's motion (N,) on a ground motion (N,) sampled every ``step_s``, at rest before its start."""
    from scipy.signal import bilinear, lfilter

    b, a = bilinear(*mode.transfer(), fs=1.0 / step_s)
    return np.asarray(lfilter(b, a, ground - ground[0]) + ground[0])


#: How fast the air suspension lets air in or out, s.
LEVELLING_S = 10.0
#: Sprung mass, its radii of gyration about the roll and pitch axes, and its middle along the car in ``rig``.
MASS_KG, ROLL_RADIUS_M, PITCH_RADIUS_M, MIDDLE_Y_M = 2100.0, 0.6, 1.3, -0.7
_GRAVITY_M_S2 = 9.81


def levelled(deflection: Array, step_s: float, time_constant_s: float = LEVELLING_S) -> Array:
    """What an air suspension leaves of a static deflection (N,) of its springs, level at the start.

    It adds or takes air at a rate proportional to the deflection: y' = x' - y / T. A step dies away as
    exp(-t / T); a steady rate r leaves r T.
    """
    from scipy.signal import bilinear, lfilter

    b, a = bilinear([time_constant_s, 0.0], [time_constant_s, 1.0], fs=1.0 / step_s)
    return np.asarray(lfilter(b, a, deflection - deflection[0]))


def sag(mass_kg: float, x_m: float, y_m: float) -> tuple[float, float, float]:
    """Static heave (m) and slopes to the right and ahead (rad) that a mass at (x, y) in ``rig`` causes.

    Each mode's stiffness is its inertia times its squared natural frequency.
    """
    weight = mass_kg * _GRAVITY_M_S2

    def stiffness(inertia: float, mode: QuarterCar) -> float:
        return inertia * float(2 * np.pi * mode.body_hz) ** 2

    return (
        -weight / stiffness(MASS_KG, HEAVE),
        -weight * x_m / stiffness(MASS_KG * ROLL_RADIUS_M**2, ROLL),
        -weight * (y_m - MIDDLE_Y_M) / stiffness(MASS_KG * PITCH_RADIUS_M**2, PITCH),
    )
