"""The IMU between two nodes as one factor (gtsam).

C. Forster et al., "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry", TRO 2017.
"""

import gtsam
import numpy as np
from numpy.typing import NDArray

from card.estimation.imu import Imu, ImuNoise
from card.estimation.strapdown import exp_so3

Array = NDArray[np.float64]
#: Variance of the integration itself, m^2/s: what a body on springs does between two samples. It also keeps
#: position and velocity from being one and the same to the last digit.
INTEGRATION_VARIANCE = 1e-9


def parameters(noise: ImuNoise, gravity_m_s2: float) -> gtsam.PreintegrationCombinedParams:
    """gtsam's parameters for a frame whose z points up."""
    params = gtsam.PreintegrationCombinedParams.MakeSharedU(gravity_m_s2)
    params.setGyroscopeCovariance(np.eye(3) * noise.gyro_noise**2)
    params.setAccelerometerCovariance(np.eye(3) * noise.accel_noise**2)
    params.setBiasOmegaCovariance(np.eye(3) * noise.gyro_walk**2)
    params.setBiasAccCovariance(np.eye(3) * noise.accel_walk**2)
    params.setIntegrationCovariance(np.eye(3) * INTEGRATION_VARIANCE)
    return params


def preintegrate(
    imu: Imu, params: gtsam.PreintegrationCombinedParams, bias: gtsam.imuBias.ConstantBias
) -> gtsam.PreintegratedCombinedMeasurements:
    """The measurements from the first to the last of samples (N,), linearised at a bias."""
    seconds = np.diff(imu.t_ns) * 1e-9
    gyro = 0.5 * (imu.gyro[1:] + imu.gyro[:-1])
    # gtsam turns the force with the attitude at the start of a step; the mean force is that of its middle.
    halves = exp_so3(0.5 * (gyro - bias.gyroscope()) * seconds[:, None])
    unbiased = 0.5 * (imu.accel[1:] + imu.accel[:-1]) - bias.accelerometer()
    force = np.einsum("nij,nj->ni", halves, unbiased) + bias.accelerometer()
    result = gtsam.PreintegratedCombinedMeasurements(params, bias)
    for f, w, dt in zip(force, gyro, seconds, strict=True):
        if dt > 0:
            result.integrateMeasurement(f, w, dt)
    return result
