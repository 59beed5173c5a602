// SPDX-License-Identifier: Apache-2.0
// Reads an archive with Foxglove's libraries, through its index if it has one, and prints what it
// holds as JSON. 64-bit integers and -0, which JSON lacks, are printed as text.
//
//     FLEDGE_MCAP_ORACLE=DIR/node_modules node check.mjs RUN.mcap
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const require = createRequire(join(resolve(process.env.FLEDGE_MCAP_ORACLE), "check.js"));
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const bytes = new Uint8Array(readFileSync(process.argv[2]));
const readable = {
  size: async () => BigInt(bytes.byteLength),
  read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
};

const out = { indexed: false, profile: "", metadata: {}, topics: {} };
const schemas = new Map();
const channels = new Map();

function declare(record) {
  if (record.type === "Schema") {
    schemas.set(record.id, record);
  } else if (record.type === "Channel" && !channels.has(record.id)) {
    const schema = schemas.get(record.schemaId);
    const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
    channels.set(record.id, { ...record, reader: new MessageReader(definition) });
    out.topics[record.topic] = { schema: schema.name, t: [], messages: [] };
  }
}

function take(message) {
  const channel = channels.get(message.channelId);
  out.topics[channel.topic].t.push(message.logTime);
  out.topics[channel.topic].messages.push(channel.reader.readMessage(message.data));
}

const indexed = await McapIndexedReader.Initialize({ readable });
out.profile = indexed.header.profile;
for await (const metadata of indexed.readMetadata()) {
  out.metadata[metadata.name] = Object.fromEntries(metadata.metadata);
}
if (indexed.chunkIndexes.length > 0) {
  out.indexed = true;
  indexed.schemasById.forEach(declare);
  indexed.channelsById.forEach(declare);
  for await (const message of indexed.readMessages({ validateCrcs: true })) {
    take(message);
  }
  const counts = indexed.statistics.channelMessageCounts;
  for (const [id, { topic }] of channels) {
    if (counts.get(id) !== BigInt(out.topics[topic].t.length)) {
      throw new Error(`${topic}: the statistics and the messages differ in number`);
    }
  }
} else {
  const stream = new McapStreamReader({ validateCrcs: true });
  stream.append(bytes);
  for (let record; (record = stream.nextRecord()); ) {
    declare(record);
    if (record.type === "Message") {
      take(record);
    }
  }
  if (!stream.done()) {
    throw new Error("the stream reader did not reach the end");
  }
}

function plain(key, value) {
  if (typeof value === "bigint") {
    return value.toString();
  }
  if (Object.is(value, -0)) {
    return "-0";
  }
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
}
process.stdout.write(JSON.stringify(out, plain));
