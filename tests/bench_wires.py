"""Backends for the contract that all of them pass, and a pseudo-terminal with a board behind it."""

import os
import threading
import tty

from servotwin.bench.backends import MockBackend


class BoardOnTerminal:
    """A board on a pseudo-terminal, for real serial programs; its time goes some times as fast as that of the wall."""

    def __init__(self, board=None, bend=None):
        self.board = board or MockBackend()
        self.board.open()
        self._bend = bend or (lambda data: data)
        self._master, slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        os.set_blocking(self._master, False)
        while not self._stop.is_set():
            try:
                self.board.send(os.read(self._master, 4096))
            except BlockingIOError:
                pass
            except OSError:
                return
            data = self.board.read(0.005)
            if data:
                try:
                    os.write(self._master, self._bend(data))
                except OSError:
                    return
            self._stop.wait(0.001)

    def cut(self):
        """Pull the cable."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)
