"""The view token and sessions: what they permit, until when, and that nobody else can make them."""

import re

import pytest

from zv.viewer.credentials import (
    SESSION_S,
    Principal,
    Scope,
    new_session,
    scope_of,
    session_principal,
    token_principal,
    view_token,
)
from zv.viewer.settings import TOKEN_PATTERN

TOKEN = "0123456789abcdef-secret"
OTHER = "0123456789abcdef-secres"
NOW_S = 1_790_000_000.0
SCOPES = (Scope.VIEW, Scope.CONTROL)


def test_the_view_token_is_a_token_of_its_own_that_is_the_same_each_time():
    assert re.fullmatch(TOKEN_PATTERN, view_token(TOKEN))
    assert view_token(TOKEN) == view_token(TOKEN)
    assert len({TOKEN, view_token(TOKEN), view_token(OTHER), view_token(view_token(TOKEN))}) == 4


def test_each_token_has_its_scope_and_no_other_text_has_one():
    assert scope_of(TOKEN, TOKEN) is Scope.CONTROL
    assert scope_of(view_token(TOKEN), TOKEN) is Scope.VIEW
    for wrong in ("", TOKEN[:-1], OTHER, view_token(OTHER), "ä", "\udcff", "view"):
        assert scope_of(wrong, TOKEN) is None


@pytest.mark.parametrize("scope", SCOPES)
def test_a_session_keeps_its_scope_and_its_name_until_it_ends(scope):
    session = new_session(scope, TOKEN, NOW_S)
    name = session.partition(".")[0]
    known = Principal(scope, f"session {name} ({scope})", NOW_S + SESSION_S)
    assert session_principal(session, TOKEN, NOW_S) == known
    assert session_principal(session, TOKEN, NOW_S + SESSION_S - 1) == known
    assert session_principal(session, TOKEN, NOW_S + SESSION_S) is None
    assert new_session(scope, TOKEN, NOW_S).partition(".")[0] != name


@pytest.mark.parametrize("scope", SCOPES)
def test_a_session_holds_no_token_and_fits_into_a_cookie(scope):
    session = new_session(scope, TOKEN, NOW_S)
    assert re.fullmatch(r"[\w.-]{1,200}", session)
    assert TOKEN not in session
    assert view_token(TOKEN) not in session
    assert scope_of(session, TOKEN) is None


@pytest.mark.parametrize("scope", SCOPES)
def test_a_token_is_no_session_and_a_session_no_token(scope):
    token = TOKEN if scope is Scope.CONTROL else view_token(TOKEN)
    assert token_principal(token, TOKEN) == Principal(scope, f"token ({scope})")
    assert session_principal(token, TOKEN, NOW_S) is None
    assert token_principal(new_session(scope, TOKEN, NOW_S), TOKEN) is None


def test_control_ends_with_the_session_and_a_token_never_does():
    session = session_principal(new_session(Scope.CONTROL, TOKEN, NOW_S), TOKEN, NOW_S)
    token = token_principal(TOKEN, TOKEN)
    assert session is not None
    assert token is not None
    assert session.forbidden(NOW_S + SESSION_S - 1) == ""
    assert session.forbidden(NOW_S + SESSION_S) == "the session has ended"
    assert token.forbidden(NOW_S + 100 * SESSION_S) == ""


def test_no_part_of_a_session_can_be_changed():
    session = new_session(Scope.VIEW, TOKEN, NOW_S)
    assert session_principal(session.replace("view", "control"), TOKEN, NOW_S) is None
    assert session_principal(session, OTHER, NOW_S) is None
    for at in range(len(session)):
        changed = session[:at] + ("x" if session[at] != "x" else "y") + session[at + 1 :]
        assert session_principal(changed, TOKEN, NOW_S) is None
        assert session_principal(session[:at], TOKEN, NOW_S) is None


def test_the_view_token_cannot_sign():
    forged = new_session(Scope.CONTROL, view_token(TOKEN), NOW_S)
    assert session_principal(forged, TOKEN, NOW_S) is None
    for text in ("", ".", "...", "view", f".{view_token(TOKEN)}", f"view.{view_token(TOKEN)}"):
        assert session_principal(text, TOKEN, NOW_S) is None
