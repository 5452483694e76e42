#!/usr/bin/env python3
"""Registers pairs of partial scans with Open3D: FPFH, then FGR or RANSAC, then ICP.

    open3d_registration.py DIR OUT.json [--methods fgr,ransac] [--names SUBSTRING]

DIR holds pairs.json and the PLY files that `registration_quality --write DIR` makes. OUT.json gets,
for each method and pair, the 4 by 4 matrix from moving to fixed and the CPU seconds of the process
for downsampling, normals, features, global and local registration, without reading.

Parameters follow Open3D's own tutorial: voxel = max(2 edges, diameter / 80), normals within 2
voxels, FPFH within 5, FGR within 0.5 and RANSAC (100,000 iterations, 3 points, edge length and
distance checkers) within 1.5 voxels; then point-to-plane ICP of all points within 2 voxels and
again within 0.5.
FPFH depends on the side that normals point to, and Open3D leaves it open on bare points: the
peer is given the outward normals of the meshes, not counted in its time (13 and 24 of 36 pairs
without them).
"""
import argparse
import copy
import json
import pathlib
import time

import numpy as np
import open3d as o3d

registration = o3d.pipelines.registration


def cpu():
    return time.process_time()


def read_with_normals(path):
    mesh = o3d.io.read_triangle_mesh(path)
    mesh.compute_vertex_normals()
    cloud = o3d.geometry.PointCloud(mesh.vertices)
    cloud.normals = mesh.vertex_normals
    return cloud


def prepare(cloud, voxel):
    down = cloud.voxel_down_sample(voxel)
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=2.0 * voxel, max_nn=30)
    down.estimate_normals(search)
    fpfh = registration.compute_fpfh_feature(
        down, o3d.geometry.KDTreeSearchParamHybrid(radius=5.0 * voxel, max_nn=100))
    return down, fpfh


def fgr(moving, fixed, voxel):
    options = registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=0.5 * voxel)
    return registration.registration_fgr_based_on_feature_matching(
        moving[0], fixed[0], moving[1], fixed[1], options)


def ransac(moving, fixed, voxel):
    distance = 1.5 * voxel
    return registration.registration_ransac_based_on_feature_matching(
        moving[0], fixed[0], moving[1], fixed[1], True, distance,
        registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
         registration.CorrespondenceCheckerBasedOnDistance(distance)],
        registration.RANSACConvergenceCriteria(100000, 0.999))


METHODS = {"fgr": ("Open3D FPFH + FGR + ICP", fgr),
           "ransac": ("Open3D FPFH + RANSAC + ICP", ransac)}


def register(moving_cloud, fixed_cloud, voxel, coarse):
    moving_cloud = copy.deepcopy(moving_cloud)
    fixed_cloud = copy.deepcopy(fixed_cloud)
    start = cpu()
    moving = prepare(moving_cloud, voxel)
    fixed = prepare(fixed_cloud, voxel)
    found = coarse(moving, fixed, voxel)
    global_seconds = cpu() - start
    fixed_cloud.estimate_normals(
        o3d.geometry.KDTreeSearchParamHybrid(radius=voxel, max_nn=30))
    refined = found
    for reach in (2.0, 0.5):
        refined = registration.registration_icp(
            moving_cloud, fixed_cloud, reach * voxel, refined.transformation,
            registration.TransformationEstimationPointToPlane())
    return refined, global_seconds, cpu() - start


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--methods", default="fgr,ransac")
    parser.add_argument("--names", default="")
    arguments = parser.parse_args()
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    o3d.utility.random.seed(1)

    answers = []
    for pair in json.loads((arguments.directory / "pairs.json").read_text()):
        if arguments.names not in pair["name"]:
            continue
        stem = str(arguments.directory / pair["name"])
        moving = read_with_normals(stem + "_moving.ply")
        fixed = read_with_normals(stem + "_fixed_mesh.ply")
        voxel = max(2.0 * pair["edge"], pair["diameter"] / 80.0)
        for key in arguments.methods.split(","):
            name, coarse = METHODS[key]
            result, global_seconds, seconds = register(moving, fixed, voxel, coarse)
            answers.append({"method": name, "pair": pair["name"],
                            "T_fixed_moving": np.asarray(result.transformation).tolist(),
                            "fitness": result.fitness, "rmse": result.inlier_rmse,
                            "global_seconds": global_seconds, "seconds": seconds})
    arguments.output.write_text(json.dumps(answers, indent=1) + "\n")


if __name__ == "__main__":
    main()
