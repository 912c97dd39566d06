"""The open pages: one holds control, the others watch; each gets the newest message of every topic."""

import secrets
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from armkin.teach.page_key import RefusedError

MAX_TABS = 4  # most pages: a browser has six connections to a server, and STOP needs a free one
_FORGET_TIME = 20.0  # time [s] after which a page that never listened is removed


class Tab:
    """One open page."""

    def __init__(self) -> None:
        self.id = secrets.token_urlsafe(16)
        self.born = time.monotonic()
        self.listening = False
        self.press = -1  # last press of its jog button that began a jog or was released
        self._news: dict[str, Any] = {}
        self._ready = threading.Condition()

    def publish(self, topic: str, message: Any) -> None:
        """Queue a message for the page, replacing an unread one of the same topic."""
        with self._ready:
            self._news[topic] = message
            self._ready.notify()

    def hear(self, timeout: float) -> dict[str, Any]:
        """The unread messages by topic; empty after `timeout` seconds."""
        with self._ready:
            if not self._news:
                self._ready.wait(timeout)
            news, self._news = self._news, {}
            return news


Fields = Mapping[str, Any]  # of an action's body
Action = Callable[[Tab, Fields], dict[str, Any]]  # page and fields of a request -> answer


class Tabs:
    """All open pages; `on_leave` is called when the page in control is closed."""

    def __init__(self, on_leave: Callable[[], None] = lambda: None) -> None:
        self._lock = threading.RLock()
        self._tabs: dict[str, Tab] = {}
        self._control = ""
        self._on_leave = on_leave

    def open(self) -> Tab:
        """A new page. Raises RefusedError if there are too many."""
        with self._lock:
            now = time.monotonic()
            for tab in [t for t in self._tabs.values() if not t.listening and now - t.born > _FORGET_TIME]:
                del self._tabs[tab.id]
            self._check_room()
            if len(self._tabs) >= 10 * MAX_TABS:
                raise RefusedError(429, "too many pages are being opened: try again in a minute")
            tab = Tab()
            self._tabs[tab.id] = tab
            return tab

    def _check_room(self) -> None:
        if sum(tab.listening for tab in self._tabs.values()) >= MAX_TABS:
            raise RefusedError(429, f"the page is open {MAX_TABS} times already: close one of them")

    def find(self, name: str) -> Tab:
        """The page of an id. Raises RefusedError if there is none."""
        with self._lock:
            tab = self._tabs.get(name)
        if tab is None:
            raise RefusedError(410, "this page is not known any more: reload it")
        return tab

    def enter(self, tab: Tab) -> None:
        """Begin to listen, and take control if no page has it."""
        with self._lock:
            if tab.listening or tab.id not in self._tabs:
                raise RefusedError(410, "this page is not known any more: reload it")
            self._check_room()
            tab.listening = True
            if not self._control:
                self._control = tab.id
            self._announce()

    def close_tab(self, tab: Tab) -> None:
        """Remove a closed page."""
        with self._lock:
            had_control = self._control == tab.id
            self._tabs.pop(tab.id, None)
            if had_control:
                self._control = ""
            self._announce()
        if had_control:
            self._on_leave()

    def take_control(self, tab: Tab) -> None:
        """Give a page control."""
        with self._lock:
            self._control = tab.id
            self._announce()

    def check_control(self, tab: Tab) -> None:
        """Raise RefusedError unless the page holds control."""
        with self._lock:
            if self._control != tab.id:
                raise RefusedError(409, "another page holds control: take control first")

    def publish(self, topic: str, message: Any, except_tab: Tab | None = None) -> None:
        """Send a message to all pages except `except_tab`."""
        with self._lock:
            for tab in self._tabs.values():
                if tab is not except_tab:
                    tab.publish(topic, message)

    def _announce(self) -> None:
        other_holder = "another" if self._control else "nobody"
        for tab in self._tabs.values():
            holder = "yours" if self._control == tab.id else other_holder
            tab.publish("control", {"holder": holder, "pages": len([t for t in self._tabs.values() if t.listening])})
