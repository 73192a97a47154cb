import pytest

from endoscope_nodes.runtime.declared_parameters import check_sections, given_to_nodes
from endoscope_nodes.runtime.parameters import ParameterError

HERE = '/endoscope'


@pytest.fixture
def check(tmp_path):
    def check(text, *more, namespace=HERE):
        file = tmp_path / 'given.yaml'
        file.write_text(text)
        return check_sections(['--ros-args', '--params-file', str(file), *more], namespace)

    return check


@pytest.mark.parametrize(
    'section',
    [
        '/endoscope/recorder',
        'endoscope/recorder',
        '/**/recorder',
        '/*/recorder',
        '/**',
        '/endoscope/*',
        '/endoscope/**',
    ],
)
def test_what_rcl_gives_to_a_node_here_is_not_worth_a_word(check, section):
    assert check(f'{section}:\n  ros__parameters: {{autostart: false}}\n') == []


def test_sections_may_be_nested(check):
    assert check('endoscope:\n  recorder:\n    ros__parameters: {autostart: false}\n') == []
    with pytest.raises(ParameterError, match=r"'/endoscope/recoder'.* did you mean recorder"):
        check('endoscope:\n  recoder:\n    ros__parameters: {autostart: false}\n')


@pytest.mark.parametrize(
    ('section', 'said'),
    [
        ('/**/recoder', 'did you mean recorder'),
        ('/endoscope/recoder', 'did you mean recorder'),
        ('/arm1/recoder', 'did you mean recorder'),
        ('recorder', r"write '/endoscope/recorder' or '/\*\*/recorder'"),
        ('/master', r"write '/endoscope/master' or '/\*\*/master'"),
    ],
)
def test_a_section_that_reaches_no_node_is_refused(check, section, said):
    with pytest.raises(ParameterError, match=rf'given\.yaml: section .* {said}'):
        check(f'{section}:\n  ros__parameters: {{bag: a}}\n')


def test_a_node_without_its_namespace_is_one_at_the_top(check):
    assert check('recorder:\n  ros__parameters: {bag: a}\n', namespace='/') == []


def test_what_is_for_another_rig_is_said(check):
    [line] = check('/arm1/recorder:\n  ros__parameters: {bag: a}\n')
    assert "section '/arm1/recorder' is for no node in /endoscope" in line
    assert check('/arm1/recorder:\n  ros__parameters: {bag: a}\n', namespace='/arm1') == []


def test_a_renamed_node_is_known(check):
    assert check('/**/left:\n  ros__parameters: {bag: a}\n', '-r', 'recorder:__node:=left') == []


def test_a_parameter_twice_is_refused(check):
    with pytest.raises(ParameterError, match="'/\\*\\*/recorder' has the parameter 'bag' twice"):
        check('/**/recorder:\n  ros__parameters:\n    bag: a\n    bag: b\n')


def test_a_rule_for_one_node_is_for_it_in_any_namespace():
    args = ['--ros-args', '-p', 'recorder:bag:=a:b:=c', '-p', 'watch:active:=true', '-p', 'keep:=1']
    assert given_to_nodes(args) == {'recorder': {'bag': 'a:b:=c'}, 'watch': {'active': True}}
    assert check_sections(args, HERE) == check_sections(args, '/') == []
    with pytest.raises(ParameterError, match="there is no node 'recoder'; did you mean recorder"):
        check_sections(['--ros-args', '-p', 'recoder:bag:=a'], HERE)
