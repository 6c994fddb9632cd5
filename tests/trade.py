"""The trade's rows made by hand: two runs, of which one has no MirrorNet."""

ERRORS = {
    "mask_iou": 0.95,
    "exponent_exact": 0.4,
    "log_exponent_mae": 0.3,
    "diffuse_albedo_mae": 0.08,
    "specular_albedo_mae": 0.2,
    "specular_shading_relative": 0.5,
    "mirror_relative": 0.8,
    "relighting_psnr": 24.0,
}


def row(model, latency, score, **changes):
    """A whole system under ONNX Runtime, one image on both of two cores."""
    errors = {name: value * score for name, value in ERRORS.items()}
    if model == "ablation":
        del errors["mirror_relative"]
    return {
        "model": model,
        "kind": "system",
        "part": "everything",
        "image_size": 64,
        "runtime": "ONNX Runtime",
        "precision": "float32",
        "batch": 1,
        "threads": 2,
        "latency_ms": latency,
        "p95_ms": 1.5 * latency,
        "samples": 30,
        "images_per_second": 1000 / latency,
        "spread": 0.05,
        "cold_start_ms": 700.0,
        "import_ms": 100.0,
        "load_ms": 200.0,
        "first_ms": 2 * latency,
        "busy": 1.9,
        "peak_memory_mib": 130.0,
        "model_mib": 11.0,
        "parameters": 2.8e6,
        "gflop": 3.0,
        "measured_on": "Keras",
        "errors": errors,
        "interval": {name: [value - 0.01, value + 0.01] for name, value in errors.items()},
        "count": 1000,
        "difference": 1e-6,
        "score": score,
        "front": False,
    } | changes


ROWS = [
    row("full", 22.0, 0.5, front=True),
    row("full", 27.0, 0.5, runtime="Keras"),
    row("full", 12.0, 0.55, precision="int8", measured_on="ONNX Runtime", front=True),
    row("full", 13.0, 0.60, precision="int8, float heads", measured_on="ONNX Runtime"),
    row("ablation", 15.0, 0.7, runtime="SavedModel", precision="bfloat16"),
    row("ablation", 15.0, 0.7),
]
