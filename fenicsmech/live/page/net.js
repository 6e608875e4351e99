// The WebSocket of the page: events from the server, messages to it; connects again when it is lost.

// The page shows its own edits at once. Events of these sorts that the server sent before it heard of the last edit would
// take it back, and are dropped: a `project` follows each edit. A `solver` follows each message, and is held to all.
const OF_EDITS = ["project", "iterate", "fitted"];

export function connect(receive, lost) {
  let socket, wait = 250, sent = 0, edited = 0; // messages of this connection, and those up to the last edit
  const late = ({ event, heard }) => heard < (event === "solver" ? sent : OF_EDITS.includes(event) ? edited : 0);
  const open = () => {
    socket = new WebSocket(`ws://${location.host}${location.pathname}ws`);
    socket.onopen = () => { wait = 250; sent = edited = 0; };
    socket.onmessage = (message) => { const event = JSON.parse(message.data); if (!late(event)) receive(event); };
    socket.onclose = () => { lost(); setTimeout(open, wait); wait = Math.min(2 * wait, 4000); };
  };
  open();
  return (message) => {
    if (socket.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(message));
    sent += 1;
    if (message.kind === "edit") edited = sent;
    return true;
  };
}
