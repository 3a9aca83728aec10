// Copyright 2026 The linkage_ros authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// Prints what an MCAP file holds, a JSON object a line:
//
//     node read.cjs indexed FILE   by its index, messages in the order of log times
//     node read.cjs streamed FILE  from its beginning on, as far as it goes, as it stands there
//
// All checksums are validated. Integers of 64 bits, -0 and what JSON has no number for are texts.
// CommonJS, so that NODE_PATH says where the packages are.

'use strict';

const { createHash } = require('node:crypto');
const { open, readFile } = require('node:fs/promises');

const { parse } = require('@foxglove/rosmsg');
const { MessageReader } = require('@foxglove/rosmsg2-serialization');
const decompressLz4 = require('@foxglove/wasm-lz4');
const zstd = require('@foxglove/wasm-zstd');
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');

const decompressHandlers = {
  lz4: (packed, size) => decompressLz4(packed, Number(size)),
  zstd: (packed, size) => zstd.decompress(packed, Number(size)),
};

function print(kind, content) {
  process.stdout.write(`${JSON.stringify({ kind, ...content }, plain)}\n`);
}

function plain(_, value) {
  if (typeof value === 'bigint') {
    return String(value);
  }
  if (typeof value === 'number' && (!Number.isFinite(value) || Object.is(value, -0))) {
    return Object.is(value, -0) ? '-0' : String(value);
  }
  if (value instanceof Map) {
    return Object.fromEntries(value);
  }
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
}

// Prints messages with the content that their channels' schemas give them.
class MessagePrinter {
  #schemas = new Map();
  #channels = new Map();
  #readers = new Map();

  addSchema({ id, name, encoding, data }) {
    const text = new TextDecoder('utf-8', { fatal: true }).decode(data);
    const known = this.#schemas.has(id);
    this.#schemas.set(id, text);
    if (!known) {
      print('schema', { id, name, encoding, text });
    }
  }

  addChannel({ id, schemaId, topic, messageEncoding, metadata }) {
    const known = this.#channels.has(id);
    this.#channels.set(id, { topic, schemaId });
    if (!known) {
      print('channel', { id, schemaId, topic, messageEncoding, metadata });
    }
  }

  addMessage({ channelId, sequence, logTime, publishTime, data }) {
    const { topic, schemaId } = this.#channels.get(channelId);
    const reader = this.#reader(schemaId);
    const message = reader.readMessage(data);
    print('message', {
      topic,
      sequence,
      logTime,
      publishTime,
      sha256: createHash('sha256').update(data).digest('hex'),
      left: reader.lastReadHadTrailingBytes(),
      message,
    });
  }

  #reader(schemaId) {
    let reader = this.#readers.get(schemaId);
    if (reader === undefined) {
      const definitions = parse(this.#schemas.get(schemaId), { ros2: true });
      reader = new MessageReader(definitions);
      this.#readers.set(schemaId, reader);
    }
    return reader;
  }
}

function printAttachment({ name, mediaType, logTime, createTime, data }) {
  const base64 = Buffer.from(data).toString('base64');
  print('attachment', { name, mediaType, logTime, createTime, base64 });
}

async function readIndexed(path) {
  const file = await open(path);
  try {
    const readable = {
      size: async () => (await file.stat({ bigint: true })).size,
      read: async (offset, length) => {
        const { buffer, bytesRead } = await file.read({
          buffer: new Uint8Array(Number(length)),
          position: offset,
        });
        if (bytesRead !== Number(length)) {
          throw new Error(`${bytesRead} bytes are there at ${offset}, not ${length}`);
        }
        return buffer;
      },
    };
    const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
    print('header', reader.header);
    const printer = new MessagePrinter();
    for (const schema of reader.schemasById.values()) {
      printer.addSchema(schema);
    }
    for (const channel of reader.channelsById.values()) {
      printer.addChannel(channel);
    }
    for await (const attachment of reader.readAttachments()) {
      printAttachment(attachment);
    }
    for await (const message of reader.readMessages()) {
      printer.addMessage(message);
    }
    for await (const record of reader.readMetadata()) {
      print('metadata', record);
    }
    print('statistics', reader.statistics);
    const packings = new Set(reader.chunkIndexes.map((chunk) => chunk.compression));
    print('chunks', { count: reader.chunkIndexes.length, packings: [...packings] });
  } finally {
    await file.close();
  }
}

async function readStreamed(path) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(await readFile(path));
  const printer = new MessagePrinter();
  const take = {
    Header: (record) => print('header', record),
    Schema: (record) => printer.addSchema(record),
    Channel: (record) => printer.addChannel(record),
    Message: (record) => printer.addMessage(record),
    Attachment: printAttachment,
    Metadata: (record) => print('metadata', record),
    Statistics: (record) => print('statistics', record),
  };
  for (let record = reader.nextRecord(); record; record = reader.nextRecord()) {
    take[record.type]?.(record);
  }
  print('end', { whole: reader.done() });
}

async function main() {
  const [how, path] = process.argv.slice(2);
  await Promise.all([decompressLz4.isLoaded, zstd.isLoaded]);
  await { indexed: readIndexed, streamed: readStreamed }[how](path);
}

main().catch((error) => {
  console.error(error);
  process.exitCode = 1;
});
