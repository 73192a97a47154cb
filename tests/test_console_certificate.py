"""The console at another address than localhost: only with a certificate, and then encrypted."""

import json
import os
import shutil
import ssl
import subprocess
import urllib.error
import urllib.request

import pytest
from console_rig import Server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from endoscope_bringup.cli import main
from endoscope_nodes.runtime.private_domain import private_domain

_ADDRESS = '127.0.0.2'
_PATIENCE_S = 60.0

pytestmark = pytest.mark.skipif(
    shutil.which('openssl') is None, reason='openssl, which makes certificates, is missing'
)


def certified(folder, name, *words):
    """A certificate of its own and its key."""
    certificate, key = folder / f'{name}.pem', folder / f'{name}.key'
    subprocess.run(
        [
            *('openssl', 'req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:P-256'),
            *('-subj', f'/CN={name}', '-addext', f'subjectAltName=IP:{_ADDRESS}', '-days', '2'),
            *('-out', certificate, '-keyout', key, *(words or ('-nodes',))),
        ],
        check=True,
        capture_output=True,
    )
    return certificate, key


@pytest.fixture
def environment():
    return os.environ | {'ROS_DOMAIN_ID': str(private_domain())}


def test_who_has_a_certificate_is_served_encrypted_and_nothing_in_the_clear(tmp_path, environment):
    certificate, key = certified(tmp_path, 'console')
    words = ('--no-graph', '--host', _ADDRESS, '--certificate', certificate, '--key', key)
    server = Server(tmp_path, environment, *words)
    try:
        assert server.address.startswith(f'https://{_ADDRESS}:')
        trusted = ssl.create_default_context(cafile=certificate)
        with urllib.request.urlopen(server.address, context=trusted) as page:
            assert b'<html' in page.read()
        url = f'{server.address.replace("https", "wss")}/command'
        with connect(url, origin=server.address, ssl=trusted, compression=None) as page:
            page.send(json.dumps({'op': 'hello', 'token': server.token}))
            assert json.loads(page.recv(timeout=_PATIENCE_S))['role'] == 'operator'
        in_the_clear = server.address.replace('https', 'http')
        with pytest.raises(InvalidStatus), connect(url, origin=in_the_clear, ssl=trusted):
            pass
        with pytest.raises((OSError, urllib.error.URLError)):
            urllib.request.urlopen(in_the_clear, timeout=_PATIENCE_S)
    finally:
        assert server.end() == 0


def test_what_cannot_be_served_encrypted_is_not_served(tmp_path, capsys):
    certificate, key = certified(tmp_path, 'console')
    _, anothers = certified(tmp_path, 'another')
    _, locked = certified(tmp_path, 'locked', '-passout', 'pass:word')
    for words, message in (
        (['--host', '192.0.2.1'], 'for all to read'),
        (['--host', '0.0.0.0'], 'give the one address'),
        (['--certificate', certificate], 'belong together'),
        (['--certificate', certificate, '--key', tmp_path / 'no.key'], 'no such file'),
        (['--certificate', certificate, '--key', anothers], 'are not a PEM certificate'),
        (['--certificate', certificate, '--key', locked], 'without a password'),
        (['--certificate', key, '--key', certificate], 'are not a PEM certificate'),
    ):
        command = ['console', '--no-graph', '--port', '0', *map(str, words)]
        assert main(command) == 2, words
        out, errors = capsys.readouterr()
        assert out == ''
        assert message in errors, words
        assert 'Traceback' not in errors
