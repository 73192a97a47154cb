// Reads an MCAP file with Foxglove's decoders, by its index and as a stream, and prints what it
// found as JSON. Times are strings: they do not fit into a number.
import { open } from 'node:fs/promises';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { FileHandleReadable } from '@mcap/nodejs';
import { loadDecompressHandlers } from '@mcap/support';

const plain = (key, value) => {
  if (typeof value === 'bigint') return value.toString();
  if (ArrayBuffer.isView(value)) return Array.from(value);
  if (value instanceof Map) return Object.fromEntries(value);
  return value;
};

// The type of what a path of a layout leads to, by the definitions of a message; null for nowhere.
function typeAt(definitions, path) {
  let fields = definitions[0].definitions;
  let found = null;
  for (const step of path.split('.')) {
    const [, name, index] = /^(\w+)(?:\[(\d+)\])?$/.exec(step) ?? [];
    found = fields?.find((field) => field.name === name && !field.isConstant);
    if (!found || Boolean(found.isArray) !== (index !== undefined)) return null;
    fields = definitions.find((other) => other.name === found.type)?.definitions;
  }
  return found.isComplex ? null : found.type;
}

async function throughIndex(path, decompressHandlers, paths) {
  const file = await open(path, 'r');
  const reader = await McapIndexedReader.Initialize({
    readable: new FileHandleReadable(file),
    decompressHandlers,
  });
  const decoders = new Map();
  const topics = {};
  const led = {};
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(channel.id)) {
      const text = new TextDecoder().decode(schema.data);
      const definitions = parse(text, { ros2: true });
      decoders.set(channel.id, new MessageReader(definitions));
      for (const [type, value] of paths) {
        if (type === schema.name) led[`${type}.${value}`] = typeAt(definitions, value);
      }
    }
    const decoded = decoders.get(channel.id).readMessage(message.data);
    topics[channel.topic] ??= {
      type: schema.name,
      schemaEncoding: schema.encoding,
      messageEncoding: channel.messageEncoding,
      metadata: channel.metadata,
      count: 0,
      sequences: 0,
      sum: 0,
      first: { logTime: message.logTime, publishTime: message.publishTime, decoded },
    };
    const topic = topics[channel.topic];
    topic.count += 1;
    topic.sequences += message.sequence;
    for (const name of ['position', 'velocity', 'effort']) {
      for (const value of decoded[name] ?? []) topic.sum += value;
    }
    topic.last = { logTime: message.logTime, publishTime: message.publishTime, decoded };
  }
  await file.close();
  const compressions = [...new Set(reader.chunkIndexes.map((chunk) => chunk.compression))];
  return { header: reader.header, statistics: reader.statistics, compressions, topics, led };
}

async function asStream(path, decompressHandlers) {
  const file = await open(path, 'r');
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  const counts = {};
  for await (const block of file.createReadStream()) {
    reader.append(block);
    for (let record; (record = reader.nextRecord()); ) {
      counts[record.type] = (counts[record.type] ?? 0) + 1;
    }
  }
  return { counts, done: reader.done() };
}

const [path, paths] = process.argv.slice(2);
const handlers = await loadDecompressHandlers();
const result = {
  index: await throughIndex(path, handlers, JSON.parse(paths)),
  stream: await asStream(path, handlers),
};
process.stdout.write(JSON.stringify(result, plain));
