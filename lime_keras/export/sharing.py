"""Graphs that several sets of weights have in common are kept once.

`python -m lime_keras.export.sharing` removes the others. Sets whose U-Nets are the
same, as `lime-train --freeze` leaves them, would else hold each twice.
"""

import dataclasses

from lime_keras.io import graph_folder, model_folder


def share() -> list[str]:
    """Remove each graph from all sets that come with the package but the first that holds it.

    The default set is the first, and the others follow by name.

    Returns:
        What was removed, such as `uniform: specular of live`.
    """
    sets = model_folder.shipped()
    order = sorted(sets, key=lambda name: (name != model_folder.DEFAULT, name))
    holders: dict[tuple[str, str], str] = {}
    told = []
    for name in order:
        folder = model_folder.graphs(sets[name])
        description = graph_folder.read(folder)
        if description is None:
            continue
        graphs = {}
        for part, graph in description.graphs.items():
            holder = holders.setdefault((part, graph.sha256), name)
            graphs[part] = dataclasses.replace(graph, held_by=None if holder == name else holder)
            own = folder / f"{part}.onnx"
            if holder != name and own.is_file():
                own.unlink()
                told.append(f"{name}: {part} of {holder}")
        graph_folder.write(folder, dataclasses.replace(description, graphs=graphs))
    return told


if __name__ == "__main__":
    print("\n".join(share()))
