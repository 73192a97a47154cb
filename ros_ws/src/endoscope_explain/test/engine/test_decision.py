"""What is said of two joints that one tracker reads."""

from types import SimpleNamespace

from endoscope_explain.decision import Decision, with_devices_agreed


def composition(*effects):
    """A composition as far as a decision looks into it."""
    return SimpleNamespace(effects=effects)


def decided(chosen, rivals):
    """A decision for one effect with rivals."""
    return Decision(
        composition(chosen), True, 0.9, {chosen: rivals}, {chosen: 50.0}, {chosen: 10.0}
    )


def search_of(*effects):
    """A search that tried single effects."""
    tried = [composition(effect) for effect in effects]
    return SimpleNamespace(tried=lambda: tried)


def test_a_late_tracker_is_late_for_both_joints():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [decided('tracker_delay', ()), decided('joint_inertia', ('tracker_delay',))]
    agreed = with_devices_agreed(searches, decisions)
    assert [d.chosen.effects for d in agreed] == [('tracker_delay',), ('tracker_delay',)]
    assert agreed[1].alternatives['tracker_delay'] == ()


def test_an_effect_without_that_rival_stays():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [decided('tracker_delay', ()), decided('joint_inertia', ('breathing',))]
    assert with_devices_agreed(searches, decisions) == decisions


def test_nothing_spreads_from_a_joint_that_is_itself_in_doubt():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [
        decided('tracker_delay', ('breathing',)),
        decided('joint_inertia', ('tracker_delay',)),
    ]
    assert with_devices_agreed(searches, decisions) == decisions
