"""The service behind a TLS proxy, with the configuration of docs/competitions/organisers.md in a real nginx."""

from __future__ import annotations

import os
import re
import shutil
import ssl
import subprocess
from pathlib import Path

import httpx
import pytest

from tests.ports import kept_port
from tests.services import STANDING, Person, competition_text, serving, wait_until
from tests.tools import need

pytestmark = pytest.mark.tools

NGINX, OPENSSL = shutil.which("nginx", path="/usr/sbin:/usr/bin"), shutil.which("openssl")
PAGE = Path(__file__).parents[2] / "docs" / "competitions" / "organisers.md"


def proxy_file(folder: Path, port: int, upstream: str) -> Path:
    """Write the configuration of the page for organisers with our ports, certificate and folders; return where."""
    found = re.search(r"```nginx\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert found is not None
    server = found[1].replace("listen 443 ssl", f"listen 127.0.0.1:{port} ssl")
    server = server.replace("compete.example.org", "localhost").replace("http://127.0.0.1:8000", upstream)
    server = server.replace("/etc/ssl/compete.pem", f"{folder}/cert.pem").replace(
        "/etc/ssl/compete.key", f"{folder}/cert.key"
    )
    temporary = "".join(
        f"{name}_temp_path {folder}/{name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    user = "user root;" if os.geteuid() == 0 else ""
    path = folder / "nginx.conf"
    path.write_text(
        f"{user} pid {folder}/nginx.pid; error_log {folder}/error.log; events {{}}\n"
        f"http {{ access_log off; {temporary}\n{server}\n}}\n"
    )
    return path


def test_people_and_clients_come_by_https(tmp_path: Path) -> None:
    need("" if NGINX and OPENSSL else "nginx or openssl", "scripts/system-packages.sh installs them")
    subprocess.run(
        [OPENSSL, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=localhost",
         "-addext", "subjectAltName=DNS:localhost", "-keyout", "cert.key", "-out", "cert.pem"],
        cwd=tmp_path, check=True, capture_output=True,
    )  # fmt: skip
    port = kept_port()
    url = f"https://localhost:{port}"
    (tmp_path / "short.toml").write_text(competition_text())
    arguments = ("--workers", "0", "--competition", str(tmp_path / "short.toml"))
    with serving(tmp_path / "here", *arguments, settings=f'url = "{url}"\nlogins = 6\n', behind=True) as service:
        configuration = proxy_file(tmp_path, port, service.url)
        proxy = subprocess.Popen([NGINX, "-p", str(tmp_path), "-c", str(configuration), "-g", "daemon off;"])
        try:
            checked(url, service.code, ssl.create_default_context(cafile=str(tmp_path / "cert.pem")))
        finally:
            proxy.terminate()
            proxy.wait(timeout=600)


def checked(url: str, code: str, trusted: ssl.SSLContext) -> None:
    def is_there() -> bool:
        try:
            return httpx.get(f"{url}/status", verify=trusted).status_code == 200
        except httpx.HTTPError:
            return False

    wait_until(is_there)
    organiser = Person(url, verify=trusted)
    organiser.join(code, "Olga")
    cookies = [cookie for cookie in organiser.http.cookies.jar if cookie.name in ("__Host-session", "__Host-csrf")]
    assert len(cookies) == 2
    assert all(cookie.secure for cookie in cookies)
    assert f"{url}/join?code=" in organiser.post("/desk/invite", form="/desk", role="participant").text
    person = Person(url, verify=trusted).join(organiser.invite(), "Ann", "Ants")
    big = f"{STANDING}\n" + "#" * 3_000_000
    assert person.submit("short/practice", big) == 1
    assert person.state(1) == "received"
    guesses = [Person(url, verify=trusted) for _ in range(2)]
    answers = [guesses[k % 2].post("/login", name="Olga", password="wrong").status_code for k in range(9)]
    assert answers[0] == 200
    assert 429 in answers
    wrong = {"password": "wrong wrong", "new": "another secret"}
    wait_until(lambda: person.post("/team/password", form="/team", **wrong).status_code == 429, pause=0.0)
    for one in (organiser, person, *guesses):
        one.http.close()
