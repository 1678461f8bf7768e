"""A resource in use is never freed under its user."""

from __future__ import annotations

import threading

from services.camera.sources.closing import Closing


def test_closing_frees_once():
    freed: list[str] = []
    closing = Closing(lambda: freed.append("freed"))
    closing.close()
    closing.close()
    assert freed == ["freed"]


def test_a_resource_in_use_is_freed_by_its_user_when_the_call_returns():
    freed: list[str] = []
    closing = Closing(lambda: freed.append(threading.current_thread().name))
    in_use, may_end = threading.Event(), threading.Event()

    def use() -> None:
        with closing.using():
            in_use.set()
            assert may_end.wait(5)
            assert not freed

    user = threading.Thread(target=use, name="user")
    user.start()
    assert in_use.wait(5)
    closing.close()
    assert closing.closed
    assert not freed
    may_end.set()
    user.join(5)
    assert freed == ["user"]
