"""The recipes that come with the package, and a user's own."""

import dataclasses

import pytest

from lime_keras.eval import cli as eval_cli
from lime_keras.model import folder as model_folder
from lime_keras.networks import PRESETS
from lime_keras.render import cli as render_cli
from lime_keras.train import cli, recipes
from lime_keras.train.recipes import steps
from lime_keras.train.stages import SCHEDULES

PARSERS = {"lime-train": cli.parser, "lime-eval": eval_cli.parser}


def _parsed(command):
    """Return the options of a step's command, as the command itself reads them."""
    name, *words = command
    if name == "lime-render":
        parser = render_cli.commands() if words[0] == "views" else render_cli.parser()
    else:
        parser = PARSERS[name]()
    return parser.parse_args(words)


@pytest.mark.parametrize("name", recipes.NAMES)
def test_every_command_of_every_recipe_is_one(name):
    recipe = recipes.find(name)
    made = set()
    for title, step in steps.steps(recipe, 7, cutouts=True).items():
        options = _parsed(step.command)
        assert set(step.needs) <= made, title
        made.add(title)
        if step.command[0] == "lime-train":
            there = PRESETS[options.preset]
            stages = {stage.name for stage in SCHEDULES[options.preset].stages(there)}
            assert set(options.stages) <= stages, title
            assert options.seed == 7 and options.steps and options.rate
            training = recipe.trainings[title.removeprefix("trainings/")]
            assert options.size == (training.size or recipe.size)


@pytest.mark.parametrize("name", recipes.NAMES)
def test_every_recipe_makes_a_whole_set_of_its_size(name):
    """By its last training, whose weights come from those before, or from a whole set."""
    recipe = recipes.find(name)
    trained, before = set(), list(recipe.trainings)[-1]
    while before in recipe.trainings:
        training = recipe.trainings[before]
        trained |= {part for stage in training.stages for part in stage.split("+")}
        before = training.start_from
    whole = {"segmentation", "specular", "mirror", "exponent", "albedo"}
    assert trained == whole or before in model_folder.shipped()
    size = recipe.size or PRESETS[recipe.preset].size
    assert recipe.validation.size == size
    seeds = [one.seed for one in (*recipe.corpora.values(), recipe.validation)]
    assert len(set(seeds)) == len(seeds)
    for training in recipe.trainings.values():
        of = training.size or size
        assert not any(recipe.corpora[corpus].size % of for corpus in training.corpora)


def test_live_by_adam_is_live_but_for_the_optimiser_and_its_rates():
    live, other = (recipes.find(name) for name in ("live", "live_adam"))
    names = ["light", "material"]
    assert list(other.trainings) == names
    by_muon, by_adam = ([one.trainings[name] for name in names] for one in (live, other))
    assert [(one.optimizer, one.rate) for one in by_muon] == [("muon", 2e-3)] * 2
    assert [(one.optimizer, one.rate) for one in by_adam] == [("adam", 1e-3)] * 2
    # Its mask and M are those of live as it ships; S and the encoders begin with nothing.
    same = {"optimizer": "muon", "rate": 2e-3}
    begun = {"start_from": "mask-128", "stages": ("specular", "mirror"), "options": ()}
    assert dataclasses.replace(by_adam[0], **same, **begun) == by_muon[0]
    assert dataclasses.replace(by_adam[1], **same) == by_muon[1]
    begins = _parsed(steps.steps(other, 0, False)["trainings/light"].command)
    assert begins.fresh == ["specular", "exponent", "albedo"]


@pytest.mark.parametrize("name", ["nano", "uniform", "live_adam"])
def test_the_corpora_of_live_can_be_taken_over(name):
    live, other = (steps.steps(recipes.find(one), 0, cutouts=True) for one in ("live", name))
    corpora = [one for one in other if one.startswith("corpora/") and one != steps.VALIDATION]
    assert len(corpora) == 2 and all(other[one] == live[one] for one in corpora)


@pytest.mark.parametrize(("name", "reads"), [("live", False), ("uniform", True)])
def test_only_uniform_reads_the_split_in_its_shading(name, reads):
    options = _parsed(steps.steps(recipes.find(name), 0, False)["trainings/material"].command)
    assert PRESETS[options.preset].dichromatic
    assert (getattr(options, "with") == ["dichromatic-shading"]) == reads


@pytest.mark.parametrize("name", ["best", "nano", "uniform", "live_adam", "builtin"])
def test_the_other_sets_begin_with_live_as_it_ships(name):
    recipe = recipes.find(name)
    step = steps.steps(recipe, 0, cutouts=False)[f"trainings/{next(iter(recipe.trainings))}"]
    assert step.begins_with == "live"
    assert step.needs == tuple(f"corpora/{corpus}" for corpus in recipe.corpora)
    assert _parsed(step.command).start_from == model_folder.find("live")


def test_without_cutouts_the_commands_have_none():
    for name, step in steps.steps(recipes.find("live"), 0, cutouts=False).items():
        assert "--cutouts" not in step.command and name != steps.PLACES
        assert steps.PLACES not in step.needs


def test_places_of_cut_outs_are_data():
    masks = dataclasses.replace(recipes.live.RECIPE.trainings["decoder"], corpora=("shapes",))
    plain = dataclasses.replace(recipes.builtin.RECIPE, trainings={"decoder": masks})
    assert plain.reads == {}
    packages = recipes.live.RECIPE.packages
    assert dataclasses.replace(plain, packages=packages).reads == {"environments": 15}


def test_a_scaled_recipe_differs_in_its_lengths_alone():
    live, short = recipes.find("live"), recipes.find("live").scaled(0.002)
    assert [one.steps for one in short.trainings.values()] == [
        max(1, round(one.steps / 500)) for one in live.trainings.values()
    ]
    assert short.corpora["meshes"].count == 72 and short.validation.count == 40
    same = {"corpora": live.corpora, "trainings": live.trainings, "validation": live.validation}
    assert dataclasses.replace(short, **same) == live


def test_a_users_file_is_a_recipe(tmp_path):
    path = tmp_path / "my.py"
    path.write_text(
        "import dataclasses\n"
        "from lime_keras.train.recipes import live\n"
        "RECIPE = dataclasses.replace(live.RECIPE, seed=3)\n"
    )
    assert recipes.find(str(path)) == dataclasses.replace(recipes.find("live"), seed=3)
    for text, words in (
        ("RECIPE = 1", "defines no RECIPE"),
        ("1 / 0", "is no recipe: ZeroDivisionError"),
        ("RECIPE = (", "is no recipe: SyntaxError"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=f"my.py {words}"):
            recipes.find(str(path))
    with pytest.raises(FileNotFoundError, match=r"your.py is missing: pass a recipe's file"):
        recipes.find(str(tmp_path / "your.py"))
    with pytest.raises(ValueError, match="no recipe livid: there are best, live"):
        recipes.find("livid")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"corpora": ("meshes", "none")}, "names the corpus none, and the recipe has meshes"),
        ({"start_from": "material"}, "names the earlier training material, and the recipe has"),
        ({"stages": ("speculr+mirror",)}, "names the subnetwork speculr, and the recipe has segm"),
    ],
)
def test_what_a_training_names_must_be_there(change, words):
    live = recipes.find("live")
    wrong = {"material": dataclasses.replace(live.trainings["material"], **change)}
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(live, trainings=live.trainings | wrong)
    named = {"best": live.trainings["decoder"]}, {"validation": live.corpora["large"]}
    for change in ({"trainings": live.trainings | named[0]}, {"corpora": live.corpora | named[1]}):
        with pytest.raises(ValueError, match=r"(best|validation) is a name of the package: call"):
            dataclasses.replace(live, **change)
    with pytest.raises(ValueError, match="makes no set"):
        dataclasses.replace(live, trainings={})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["corpus", "--recipe", "live"], "PATH does not go with --recipe"),
        (["--recipe", "live", "--width", "8"], "--width does not go with --recipe"),
        (["corpus", "--preset", "live", "--data", "d"], "--data is for --recipe"),
        (["--preset", "live"], "PATH is missing"),
        (["--recipe", "live", "--average", "1"], "1 is not between 0 and 1"),
    ],
)
def test_wrong_usage(arguments, words, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        cli.main([*arguments, "--out", str(tmp_path / "run")])
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err
