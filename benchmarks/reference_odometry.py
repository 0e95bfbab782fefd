"""KISS-ICP and RKO-LIO on scans that the caller has put into files, run by a Python that has them.

    <python> benchmarks/reference_odometry.py kiss_icp|rko_lio FOLDER

FOLDER holds imu.npz (t_ns, gyro, accel) and <number>.npz a scan (points in rig, m; time_ns a point);
poses.npy (N, 4, 4) of the rig, as the system has it after each scan, is written beside them.
"""

import sys
from pathlib import Path

import numpy as np


def kiss_icp(scans, imu):
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    # Their own default where no voxel size is given.
    config.mapping.voxel_size = config.data.max_range / 100
    system = KissICP(config)
    for points, time_ns in scans:
        since = (time_ns - time_ns[0]).astype(np.float64)
        system.register_frame(points, since / since.max())
        yield system.last_pose


def rko_lio(scans, imu):
    from rko_lio.config import LIOConfig
    from rko_lio.lio import LIO

    system, fed = LIO(LIOConfig()), 0
    for points, time_ns in scans:
        while fed < len(imu["t_ns"]) and imu["t_ns"][fed] <= time_ns.max():
            system.add_imu_measurement(imu["accel"][fed], imu["gyro"][fed], int(imu["t_ns"][fed]))
            fed += 1
        system.register_scan(points, time_ns)
        yield system.pose()


def main():
    name, folder = sys.argv[1], Path(sys.argv[2])
    imu = dict(np.load(folder / "imu.npz"))
    files = sorted(folder.glob("[0-9]*.npz"))
    scans = (tuple(np.load(file)[key] for key in ("points", "time_ns")) for file in files)
    system = {"kiss_icp": kiss_icp, "rko_lio": rko_lio}[name]
    np.save(folder / "poses.npy", np.stack([np.array(pose) for pose in system(scans, imu)]))


if __name__ == "__main__":
    main()
