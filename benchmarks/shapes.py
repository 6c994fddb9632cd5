"""The cost of shapes without end: processor time and faces, by family.

    OMP_NUM_THREADS=1 python benchmarks/shapes.py [--count 50]

Each row is one family of `render.shapes.endless`: its share of the draws, the mean and the largest
time of a mesh, its faces (median, 90 %), and the share of the unit sphere that it fills (median).
"""

import argparse
import time

import numpy as np

from lime_keras.render.shapes import endless, meshes


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=50, help="meshes of each family")
    chosen = options.parse_args()
    print("| family | share | mean ms | largest ms | faces | 90 % | filled |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    total = 0.0
    for name, (share, make) in endless.FAMILIES.items():
        drawn, times = _timed(make, range(chosen.count))
        faces = [len(mesh.faces) for mesh in drawn]
        filled = np.median([_volume(mesh) for mesh in drawn]) / (4 / 3 * np.pi)
        total += share * times.mean()
        print(
            f"| {name} | {share:.3f} | {times.mean():.1f} | {times.max():.0f} | "
            f"{np.median(faces):.0f} | {np.quantile(faces, 0.9):.0f} | {filled:.3f} |",
            flush=True,
        )
    print(f"\nmean of all draws: {total:.1f} ms")


def _timed(make, seeds) -> tuple[list[meshes.Mesh], np.ndarray]:
    """Return the meshes of the seeds, and the processor time of each in milliseconds."""
    drawn, times = [], []
    for seed in seeds:
        start = time.process_time()
        drawn.append(make(np.random.default_rng(seed)))
        times.append(1e3 * (time.process_time() - start))
    return drawn, np.array(times)


def _volume(mesh: meshes.Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].astype(float).swapaxes(0, 1)
    return float((np.cross(a, b) * c).sum() / 6)


if __name__ == "__main__":
    main()
