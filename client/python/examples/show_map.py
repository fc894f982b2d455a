#!/usr/bin/env python3
"""Draws the cuboids and meshes of a session into a picture. Needs python3-matplotlib.

    python3 show_map.py SESSION map.png --server 127.0.0.1:50051
"""

import argparse
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # noqa: E402

import romap  # noqa: E402

EDGES = [(a, b) for a in range(8) for b in range(8) if a < b and bin(a ^ b).count("1") == 1]
MAX_TRIANGLES = 4000  # of a mesh; Matplotlib is slow


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("session")
    arguments.add_argument("picture")
    arguments.add_argument("--server", default="127.0.0.1:50051")
    options = arguments.parse_args()
    with romap.connect(options.server) as server:
        objects = server.export(options.session).objects
    if not objects:
        sys.exit(f"show_map: session {options.session} has no objects yet")
    axes = plt.figure(figsize=(8, 8)).add_subplot(projection="3d")
    corners = np.concatenate([each.object.cuboid.corners() for each in objects])
    for each in objects:
        box = each.object.cuboid.corners()
        axes.add_collection3d(Line3DCollection([box[list(edge)] for edge in EDGES], colors="black", linewidths=0.8))
        axes.text(*box.max(axis=0), f"{each.object.id} {each.object.class_name}")
        mesh = each.world_mesh()
        if mesh is not None:
            triangles = mesh.triangles[:: 1 + len(mesh.triangles) // MAX_TRIANGLES]
            colors = "gray" if mesh.colors is None else mesh.colors[triangles].mean(axis=1) / 255
            axes.add_collection3d(Poly3DCollection(mesh.vertices[triangles], facecolors=colors))
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    plt.savefig(options.picture, dpi=120)
    print(f"{options.picture}: {len(objects)} objects")


if __name__ == "__main__":
    try:
        main()
    except romap.Error as error:
        sys.exit(f"show_map: {error}")
