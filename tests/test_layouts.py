"""Each path of the layouts leads to something in a recording of the graph.

This is not the viewers themselves, which are in no registry of packages: whether a panel looks as
it should, only a person at Foxglove, Lichtblick, PlotJuggler or RViz can see.
"""

import json
import re
import xml.etree.ElementTree as ElementTree

import pytest
import yaml
from doc_pages import WORKSPACE
from simulated_graph import SimulatedGraph

from endoscope_bags import open_bag
from endoscope_bags.message_types import typestore
from endoscope_nodes.graph import SHOWING_NODES
from endoscope_nodes.nodes.recorder import RecorderNode

LAYOUTS = WORKSPACE / 'src' / 'endoscope_bringup' / 'layouts'
FOXGLOVE = json.loads((LAYOUTS / 'foxglove.json').read_text())
PLOTJUGGLER = ElementTree.parse(LAYOUTS / 'plotjuggler.xml').getroot()
RVIZ = yaml.safe_load((LAYOUTS / 'instrument.rviz').read_text())['Visualization Manager']
PANELS = FOXGLOVE['configById']


def plotted(panel):
    """Paths of a panel of Foxglove."""
    paths = [*panel.get('paths', []), *([panel['xAxisPath']] if 'xAxisPath' in panel else [])]
    return [path['value'] for path in paths]


PATHS = sorted({path for panel in PANELS.values() for path in plotted(panel)})
CURVES = sorted(
    {
        curve.get(key)
        for plot in PLOTJUGGLER.iter('plot')
        for curve in plot.iter('curve')
        for key in (('curve_x', 'curve_y') if plot.get('mode') == 'XYPlot' else ('name',))
    }
)


@pytest.fixture(scope='module')
def messages(tmp_path_factory):
    """The last message of each topic of a recording, and its type."""
    path = tmp_path_factory.mktemp('layouts') / 'bag'
    with SimulatedGraph(
        extra=(*SHOWING_NODES, RecorderNode), overrides={'recorder': {'bag': str(path)}}
    ) as graph:
        graph.enable()
        graph.set('master', source='motion')
        graph.advance(1.5)
    bag = open_bag(path)
    return {
        message.topic: typestore().deserialize_cdr(message.data, bag.topics[message.topic].type)
        for message in bag.messages(list(bag.topics))
    }


def named(layout):
    """Ids of the panels that a layout of Foxglove arranges."""
    return [layout] if isinstance(layout, str) else named(layout['first']) + named(layout['second'])


def test_every_panel_is_arranged_once():
    assert sorted(named(FOXGLOVE['layout'])) == sorted(PANELS)


@pytest.mark.parametrize('path', PATHS)
def test_a_path_of_foxglove_leads_to_a_value(messages, path):
    topic, *fields = path.split('.')
    value = messages[topic]
    for field in fields:
        name, index = re.fullmatch(r'(\w+)(?:\[(\d+)\])?', field).groups()
        value = getattr(value, name)
        value = value if index is None else value[int(index)]
    assert isinstance(value, float | str)


def test_the_model_and_the_health_of_foxglove_are_there(messages):
    scene = PANELS['3D!instrument']
    layer = scene['layers']['instrument']
    assert layer['sourceType'] == 'topic'
    robot = ElementTree.fromstring(messages[layer['topic']].data)
    links = {link.get('name') for link in robot.iter('link')}
    moved = {transform.child_frame_id for transform in messages['/tf'].transforms}
    assert links == moved | {scene['followTf']}
    assert set(scene['topics']) <= set(messages)
    assert messages[PANELS['DiagnosticSummary!health']['topicToRender']].status


@pytest.mark.parametrize('curve', CURVES)
def test_a_curve_of_plotjuggler_leads_to_a_joint(messages, curve):
    """It names series of joints TOPIC/JOINT/QUANTITY."""
    topic, joint, quantity = curve.rsplit('/', 2)
    message = messages[topic]
    assert len(getattr(message, quantity)) == len(message.name)
    assert joint in message.name


def test_what_rviz_shows_is_there(messages):
    displays = RVIZ['Displays']
    shown = [d.get('Description Topic', d.get('Topic', {})).get('Value') for d in displays]
    assert set(filter(None, shown)) == {'/robot_description', '/endoscope/tracker/measured_cp'}
    assert set(filter(None, shown)) <= set(messages)
    frame = RVIZ['Global Options']['Fixed Frame']
    assert messages['/endoscope/tracker/measured_cp'].header.frame_id == frame
