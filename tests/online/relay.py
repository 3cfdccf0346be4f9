"""A bad network between a controller and the server: loses, delays and doubles telegrams, and adds
garbage."""

import heapq
import itertools
import random
import socket
import threading
import time

GARBAGE = (
    b"",
    b"\x00\xff" * 300,
    b"<Rob",
    b'<Rob Type="KUKA"><RIst X="1"/></Rob>',
    b'<!DOCTYPE x [<!ENTITY a "aaaa">]><Rob>&a;</Rob>',
    b"<Rob><A><B/></A><IPOC>1</IPOC></Rob>",
    b"<Rob>" + b"<A/>" * 5000 + b"</Rob>",
)


class Relay:
    """Carries datagrams both ways; the rates are probabilities for each datagram."""

    def __init__(
        self, to_controller=None, *, lose=0.0, double=0.0, delay=0.0, delay_s=0.006, garbage=0.0, seed=1
    ):
        self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # the controller sends here
        self.front.bind(("127.0.0.1", 0))
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # the server sees this as the peer
        self.back.bind(("127.0.0.1", 0))
        for side in (self.front, self.back):
            side.settimeout(0.001)
        self.port = self.front.getsockname()[1]
        self.server = None
        self.controller = to_controller
        self.shares = {"lose": lose, "double": double, "delay": delay, "garbage": garbage}
        self.delay_s = delay_s
        self.count = dict.fromkeys((*self.shares, "carried"), 0)
        self.random = random.Random(seed)
        self.waiting = []
        self.order = itertools.count()
        self.open = True
        self.threads = [
            threading.Thread(target=self._carry, args=(side,), daemon=True)
            for side in (self.front, self.back)
        ]
        self.lock = threading.Lock()

    def start(self, server_port):
        self.server = ("127.0.0.1", server_port)
        for thread in self.threads:
            thread.start()

    def close(self):
        self.open = False
        for thread in self.threads:
            thread.join()
        self.front.close()
        self.back.close()

    def _happens(self, what):
        if self.random.random() < self.shares[what]:
            self.count[what] += 1
            return True
        return False

    def _carry(self, side):
        while self.open:
            try:
                data, sender = side.recvfrom(65535)
            except (TimeoutError, ConnectionError):
                data = None
            with self.lock:
                if data is not None:
                    if side is self.front and self.controller is None:
                        self.controller = sender
                    self._pass_on(side, data)
                self._send_due()

    def _pass_on(self, side, data):
        out, target = (self.back, self.server) if side is self.front else (self.front, self.controller)
        if self._happens("garbage"):
            out.sendto(self.random.choice(GARBAGE), target)
        if self._happens("lose"):
            return
        copies = 2 if self._happens("double") else 1
        for _ in range(copies):
            if self._happens("delay"):
                due = time.monotonic() + self.delay_s
                heapq.heappush(self.waiting, (due, next(self.order), out, data, target))
            else:
                out.sendto(data, target)
                self.count["carried"] += 1

    def _send_due(self):
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            _, _, out, data, target = heapq.heappop(self.waiting)
            out.sendto(data, target)
            self.count["carried"] += 1
