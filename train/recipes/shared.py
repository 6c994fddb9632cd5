"""What the sets for photographs and the paper's materials share: corpora, masks, S and M.

Corpora of 128 pixels: 36,000 scenes of meshes and 24,000 of built-in shapes, under lights that are
mixed of maps, rooms, skies and lamps. Scenes decide: 32,000 distinct ones taught more than 64,000
of fewer shapes, so three quarters of the built-in bodies are drawn for eight scenes alone. Masks
learn at 192 pixels first, the decoder alone, as an encoder that learns beside a fresh decoder
forgets photographs; then at 128, and at the set's own size. S and M learn at 128 pixels, too.
"""

from .recipe import Corpus, Package, Training

CORPORA = {
    "meshes": Corpus(36_000, seed=1),
    "shapes": Corpus(24_000, seed=2, meshes=False, endless=0.75),
    "large": Corpus(10_000, seed=3, size=192),
}
OF_128 = ("meshes", "shapes")
VALIDATION = Corpus(640, seed=1000, materials="natural")

CUTOUTS = (
    Package("apt", "tuxpaint-stamps-default", "2022.06.04-1"),
    # Things, without faces, people, flags and signs, by their code points.
    Package(
        "npm",
        "@lobehub/fluent-emoji-3d",
        "1.1.0",
        tuple(
            "1f32d-1f384 1f388-1f393 1f3a0-1f3bb 1f3bd-1f3c0 1f3c8-1f3c9 1f3cf-1f3d3 1f3e0-1f3f0 "
            "1f3f8-1f3fa 1f400-1f43e 1f451-1f462 1f484-1f484 1f488-1f48a 1f48c-1f48e 1f490-1f490 "
            "1f4a1-1f4a1 1f4ba-1f4da 1f4dc-1f4f1 1f4f7-1f4fc 1f50b-1f514 1f525-1f52e 1f680-1f6a4 "
            "1f6b2-1f6b2 1f6bd-1f6bd 1f6c1-1f6c1 1f6d2-1f6d2 1f6d5-1f6d6 1f6dd-1f6df 1f6f4-1f6fc "
            "1f93f-1f945 1f94a-1f96f 1f97b-1f9af 1f9b4-1f9b4 1f9bc-1f9cb 1f9e0-1f9ff 1fa70-1fa75 "
            "1fa78-1fa88 1fa90-1faa9 1faab-1faad 1fab0-1fabd 1fad0-1fadb".split()
        ),
    ),
)

MASKS = {
    "decoder": Training(
        ("segmentation",),
        ("large",),
        steps=1_000,
        rate=2e-3,
        photos=10_000,
        cutouts=True,
        size=192,
        preset="live",
    ),
    "mask-192": Training(
        ("segmentation",),
        ("large",),
        steps=3_000,
        rate=1e-3,
        photos=10_000,
        start_from="decoder",
        average=0.999,
        cutouts=True,
        size=192,
        preset="live",
    ),
    "mask-128": Training(
        ("segmentation",),
        OF_128,
        steps=3_000,
        rate=1e-3,
        photos=48_000,
        start_from="mask-192",
        average=0.999,
        cutouts=True,
        size=128,
        preset="live",
    ),
}
LIGHT_128 = Training(
    ("specular", "mirror"),
    OF_128,
    steps=6_000,
    rate=2e-3,
    photos=60_000,
    start_from="mask-128",
    size=128,
    preset="live",
)
"""S and M of both laws, each alone, cut out by the masks of before."""
MATERIAL = Training(
    ("specular+mirror+exponent+albedo",),
    OF_128,
    steps=10_000,
    rate=2e-3,
    photos=60_000,
    start_from="light",
    freeze=("specular", "mirror"),
)
"""The encoders, on S as the frozen SpecularNet predicts it."""
MIRROR = Training(
    ("specular+mirror",),
    OF_128,
    steps=6_000,
    rate=5e-4,
    photos=40_000,
    optimizer="adam",  # Muon lets deep levels of MirrorNet die
    start_from="material",
    freeze=("specular",),
)
"""M learns on with S as SpecularNet finds it; in `LIGHT_128` it learnt from the true one.

It is the last training, as nothing else reads M.
"""
