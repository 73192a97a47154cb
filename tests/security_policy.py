"""What the SROS2 policy allows, by node."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

POLICY = Path(__file__).parents[1] / 'ros_ws' / 'security' / 'policy.xml'
NAMESPACE = '/endoscope'


def full(name):
    return name if name.startswith('/') else f'{NAMESPACE}/{name}'


def allowed():
    """Topics that a node may publish and subscribe, and services that it may call, by node."""
    table = {}
    for enclave in ElementTree.parse(POLICY).getroot().iter('enclave'):
        (profile,) = enclave.iter('profile')
        name = profile.get('node')
        assert enclave.get('path') == f'{NAMESPACE}/{name}'
        assert profile.get('ns') == NAMESPACE
        table[name] = {
            verb: {
                full(each.text)
                for group in profile.iter(kind)
                if group.get(verb) == 'ALLOW'
                for each in group
            }
            for verb, kind in (
                ('publish', 'topics'),
                ('subscribe', 'topics'),
                ('request', 'services'),
            )
        }
    return table
