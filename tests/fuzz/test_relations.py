"""Short form of `python -m tests.fuzz relations`."""

from __future__ import annotations

import pytest

from tests.fuzz.relations import Relation, fault, relations

RELATIONS = list(relations(3))


@pytest.mark.slow
@pytest.mark.parametrize("relation", RELATIONS, ids=lambda relation: relation.name)
def test_a_question_asked_in_two_ways_has_one_answer(relation: Relation) -> None:
    assert fault(relation) == ""


def test_a_relation_that_does_not_hold_is_seen() -> None:
    own, *_ = RELATIONS
    other = own.texts[0].replace('"F_i1": ', '"F_i1": 1')
    changed = Relation(own.name, (own.texts[0], other), own.args, own.figures_of)
    assert "F_ior_arcsec" in fault(changed)
