/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* Requests to the server, and their answers. A connection that is lost is said, and tried again. */

const Talk = (() => {
  const AGAIN = 1000; // ms
  const waiting = new Map();
  const listeners = [];
  let socket = null;
  let number = 0;

  /** Call a function with whether the server answers, and with its last words. */
  const onChange = (listener) => listeners.push(listener);
  const tell = (there, words) => listeners.forEach((listener) => listener(there, words));
  const isThere = () => socket?.readyState === WebSocket.OPEN;

  function open() {
    socket = new WebSocket(new URL('ws', location.href.replace(/^http/, 'ws')));
    socket.addEventListener('open', () => tell(true, ''));
    socket.addEventListener('message', ({ data }) => {
      const answer = JSON.parse(data);
      const asked = waiting.get(answer.id);
      waiting.delete(answer.id);
      if (!asked) return;
      if (answer.ok) asked.resolve(answer.ok);
      else asked.reject(answer.error ?? { dropped: true });
    });
    socket.addEventListener('close', ({ reason }) => {
      for (const asked of waiting.values()) asked.reject({ lost: true });
      waiting.clear();
      tell(false, reason || 'linkage view does not answer');
      setTimeout(open, AGAIN);
    });
  }

  /** Return the answer to a request; it is rejected with the error of the server. */
  function ask(what, content = {}) {
    if (!isThere()) return Promise.reject({ lost: true });
    number += 1;
    const id = number;
    return new Promise((resolve, reject) => {
      waiting.set(id, { resolve, reject });
      socket.send(JSON.stringify({ id, do: what, ...content }));
    });
  }

  /** Return a function that has one request under way, and of those that wait only the newest. */
  function newest(act) {
    let busy = false;
    let next = null;
    async function go(content) {
      if (busy) {
        next = content;
        return;
      }
      busy = true;
      try {
        await act(content);
      } finally {
        busy = false;
        if (next) {
          const last = next;
          next = null;
          go(last);
        }
      }
    }
    go.isBusy = () => busy;
    return go;
  }

  return { open, ask, newest, onChange, isThere };
})();
