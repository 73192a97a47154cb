"""Whoever asks the graph for something is told what came of that, and of nothing else."""

import dataclasses

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from simulated_graph import SimulatedGraph

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_client import GraphClient, joined_graph
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.names import DIAGNOSTICS

ABORTED = 'aborted: the motion session has ended'


@pytest.fixture(scope='module')
def graph():
    with SimulatedGraph(overrides={'calibration': {'motion': 'brief'}}) as graph:
        yield graph


@pytest.fixture(autouse=True)
def enabled(graph):
    enable(graph)


def enable(graph):
    graph.command('disable')
    graph.enable()


class Asker(GraphClient):
    """A client beside whose waiting the graph goes on, and something may happen to it once.

    It hears of nodes' health only from then on, as one that they have found last.
    """

    def __init__(self, graph, happens):
        super().__init__(graph.probe, self._live, lambda: graph.clock.now_ns * 1e-9)
        self._graph = graph
        self._happens = happens
        index = next(k for k, (s, _) in enumerate(self._heard) if s.topic == DIAGNOSTICS)
        self._heard.pop(index)[0].close()

    def _live(self, seconds):
        if self._happens is None:
            self._graph.advance(seconds)
            return
        # Time stands still until then.
        self._graph.serve(0.01)
        if self._graph.nodes['calibration'].active:
            happens, self._happens = self._happens, None
            happens()
            self.listen(DiagnosticArray, DIAGNOSTICS, self._on_health)


def calibrate(graph, happens):
    with Asker(graph, happens) as asker:
        return asker.calibrate(patience_s=5.0)


def test_one_that_ends_in_the_instant_in_which_it_began_is_told(graph):
    def lose_the_session():
        calibration = graph.nodes['calibration']
        assert calibration.ticker.now_ns() == calibration.orders.order.began_ns
        calibration._session.leave('the test ends it')

    with pytest.raises(GraphError, match=ABORTED):
        calibrate(graph, lose_the_session)


def test_a_result_that_was_there_before_is_not_taken(graph):
    with pytest.raises(GraphError, match=ABORTED):
        calibrate(graph, lambda: graph.command('disable'))
    enable(graph)
    first = calibrate(graph, lambda: None)
    assert first.level == 0
    # No time has gone on: the next one begins in the instant in which this one has ended.
    second = calibrate(graph, lambda: None)
    assert second.level == 0
    assert second.stamp_ns - float(second.values['duration']) * 1e9 >= first.stamp_ns


def go_home(graph, happens):
    with Asker(graph, None) as asker:
        asker.wait_for(lambda: asker.graph_ns > 0, 'the supervisor')
        asker._happens = happens
        return asker.home(patience_s=5.0)


def test_an_order_is_known_by_codes_whatever_is_said_of_it(graph, monkeypatch):
    orders = graph.nodes['calibration'].orders
    end = orders._end
    monkeypatch.setattr(
        orders, '_end', lambda e: end(e and dataclasses.replace(e, words=f'so: {e.words}'))
    )
    assert go_home(graph, lambda: None).startswith('so: home reached')
    # The one before, which ended well, is latched.
    with pytest.raises(GraphError, match=r'so: aborted while .*: the motion session has'):
        go_home(graph, lambda: graph.command('pause'))
    enable(graph)
    assert calibrate(graph, lambda: None).level == 0


def test_a_rejected_home_is_told_and_the_order_underway_is_known(graph):
    with GraphClient(graph.probe, graph.advance) as client:
        client.wait_for(lambda: bool(client.orders), 'calibration')
        assert client.underway is None
        assert graph.call_calibration().success
        with pytest.raises(GraphError, match='home: busy: '):
            client.home(5.0)
        assert client.underway.order == 'calibrate'
        graph.command('pause')
        client.wait_for(lambda: client.underway is None, 'the end')
        out = "'home' is not possible in PAUSED; possible are disable, pause, resume"
        with pytest.raises(GraphError, match=out):
            client.home(5.0)


class Unheard(GraphClient):
    """A client whose orders are lost on the way, beside whose waiting something happens once."""

    def __init__(self, graph, happens):
        super().__init__(graph.probe, self._live, lambda: graph.clock.now_ns * 1e-9)
        self._graph = graph
        self._happens = happens
        self.given = []

    def order(self, command):
        self.given.append(command)

    def _live(self, seconds):
        if self.given and self._happens is not None:
            happens, self._happens = self._happens, None
            happens()
        self._graph.advance(seconds)


@pytest.mark.parametrize(
    ('happens', 'withdrawn', 'said'),
    [('disable', False, 'DISABLED instead of ENABLED'), ('pause', True, 'resume was withdrawn')],
)
def test_an_order_to_move_is_not_given_again_after_what_ended_motion(
    graph, happens, withdrawn, said
):
    graph.command('pause')
    with Unheard(graph, lambda: graph.command(happens)) as asker:
        asker.wait_for(lambda: asker.state == 'PAUSED', 'the pause')
        with pytest.raises(GraphError, match=said):
            asker.ask_and_see('resume', 5.0, lambda: withdrawn and bool(asker.given))
        assert asker.given == ['resume']


def test_patience_is_in_the_graphs_time_and_ends_where_that_stands_still(graph):
    wall_s = [0.0]

    def live(seconds):
        wall_s[0] += 20.0 * seconds
        graph.advance(seconds)

    with GraphClient(graph.probe, live, lambda: wall_s[0]) as client:
        client.wait_for(lambda: client.graph_ns > 0, 'the supervisor')
        end_ns = client.graph_ns + 2e9
        assert client.wait_until(lambda: client.graph_ns >= end_ns, 3.0)
        assert not client.wait_until(lambda: client.graph_ns >= end_ns + 4e9, 3.0)
        client.serve, begun_s = lambda seconds: wall_s.append(wall_s.pop() + seconds), wall_s[0]
        assert not client.wait_until(lambda: False, 3.0)
        assert wall_s[0] - begun_s == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize('given', ['abc', '-1', '233'])
def test_a_domain_that_cannot_be_is_refused(monkeypatch, given):
    monkeypatch.setenv('ROS_DOMAIN_ID', given)
    with (
        pytest.raises(EndoscopeError, match=f"'{given}'; give a whole number from 0 to 232"),
        joined_graph('asks', ''),
    ):
        pass


def test_an_enable_waits_until_the_graph_is_whole_and_says_for_what():
    overrides = {
        'load_cells': {'connected': False},
        'simulation_clock': {'wait_for': ['motor/measured_js']},
    }
    with (
        SimulatedGraph(overrides=overrides) as graph,
        GraphClient(graph.probe, graph.advance) as client,
    ):
        told = []

        def plug_in(what):
            told.append(what)
            graph.set('load_cells', connected=True)

        client.report = plug_in
        client.find(5.0)
        assert client.ask_and_see('enable', 5.0) == 'ENABLED'
        [line] = told
        assert line.endswith('wires/measured_js has not been received')
        assert client.awaited == ''
