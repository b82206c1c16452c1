"""config.yaml: defaults, overrides, and files that may not drift away from the models."""

import pytest
import yaml
from pydantic import BaseModel

from vgyro.board import Board
from vgyro.config import Analysis, Config, merge, override_analysis, override_problems, parse_config
from vgyro.dataset import Manifest
from vgyro.describe import config_yaml, models_in, type_text
from vgyro.validation import InvalidFile


def test_config_yaml_holds_every_key_with_its_default_and_a_comment():
    text = config_yaml()
    assert parse_config(text) == Config()
    assert yaml.safe_load(text) == Config().model_dump(mode="json")
    lines = text.splitlines()
    for name, field in Analysis.model_fields["volatility"].annotation.model_fields.items():
        index = next(i for i, line in enumerate(lines) if line.strip().startswith(f"{name}:"))
        assert f"# {field.description}" in lines[index] + lines[index - 1]
    assert max(map(len, lines)) <= 120


@pytest.mark.parametrize("model", [Config, Manifest, Board])
def test_every_key_is_explained(model):
    def unexplained(part: type[BaseModel]) -> list[str]:
        found = []
        for name, field in part.model_fields.items():
            inner = models_in(field.annotation)
            if not field.description and not (inner and all(choice.__doc__ for choice in inner)):
                found.append(f"{part.__name__}.{name}")
            found += [key for choice in inner for key in unexplained(choice)]
        return found

    assert unexplained(model) == []


def test_types_are_told_in_words():
    options = Analysis.model_fields
    volatility = options["volatility"].annotation.model_fields
    fields = {name: type_text(field.annotation, field.metadata) for name, field in volatility.items()}
    assert fields["rate_hz"] == "number, or full"
    assert fields["window"] == "whole number ≥ 50"
    assert fields["modes"] == "list of in_sample, causal"
    confidence = options["metrics"].annotation.model_fields["confidence"]
    assert type_text(confidence.annotation, confidence.metadata) == "number > 0.5 and < 1"


def test_an_empty_config_means_every_default():
    assert parse_config("") == Config()
    assert parse_config("\n \n") == Config()


def test_a_manifest_overrides_only_the_keys_it_sets():
    base = Analysis.model_validate({"volatility": {"window": 400, "step": 40}, "metrics": {"seed": 3}})
    override = Analysis.model_validate({"volatility": {"step": 20}})
    merged = override_analysis(base, override)
    assert (merged.volatility.window, merged.volatility.step, merged.metrics.seed) == (400, 20, 3)
    assert override_analysis(base, None) is base


def test_lists_are_replaced_and_mappings_merged():
    assert merge({"a": {"b": 1, "c": [1, 2]}, "d": 1}, {"a": {"c": [3]}, "d": 2}) == {"a": {"b": 1, "c": [3]}, "d": 2}


def test_keys_that_clash_only_after_merging_are_named():
    base = Analysis.model_validate({"volatility": {"step": 100}})
    override = Analysis.model_validate({"volatility": {"window": 60}})
    (problem,) = override_problems(base, override, "f")
    assert problem.key == "analysis.volatility"
    assert problem.message == "step = 100 is longer than window = 60: samples would be left out"
    assert override_problems(base, None, "f") == []


def test_a_step_longer_than_the_window_is_refused():
    with pytest.raises(
        InvalidFile, match=r"config\.yaml:2: analysis\.volatility: step = 400 is longer than window = 360"
    ):
        parse_config("analysis:\n  volatility: {step: 400}\n")
