"""Controllers and e-agents in other processes.

A driver elsewhere is reached in three layers. `link.Link` is one trial's dealings with all remote cars: it shows
every frame, waits for commands as the clock says, and names what goes wrong. `drivers` fits it to the protocols
Controller and Driver. Below it, a *transport* only carries: `lines` (JSON lines over a socket), `ros1`, ...

To add a transport, write one class with the methods of `protocols.Transport`, in a module of its own here:

- `frame` sends a `View` and never waits for a peer; `announce` tells the problem; `end` says that the trial is over;
- what arrives is handed to the `protocols.Mailbox` given to `open`, from any thread: commands as they come, unfiltered;
- say `tagged = True` if commands carry the tick they answer; lockstep is then exact whatever the peer repeats;
- give it `stream` and `interval` (`protocols.Streams`) if peers expect the world more often than once a tick.

Bounded memory, floods, silence, lateness, reconnection and pauses are the link's and need no word in a transport. A
subclass of `tests.conformance.transport.TransportConformance` of some lines then tests it like every other one, and
`sessions.remote.run_remote` runs trials over it.
"""
