// Prints what an MCAP file holds, a JSON document a line: each message, decoded by the schema in the file; last a summary.
// Reads by the index, and a second time record by record with all checksums.
//
// Usage: node mcap_dump.mjs FILE    with @mcap/core, @mcap/support and protobufjs beside it
import fs from "node:fs";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const bytes = new Uint8Array(fs.readFileSync(process.argv[2]));
const decompressHandlers = await loadDecompressHandlers();
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => bytes.subarray(Number(offset), Number(offset) + Number(size)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });

const types = new Map();
function typeOf(schema) {
  if (!types.has(schema.id)) {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    root.resolveAll();
    types.set(schema.id, root.lookupType(schema.name));
  }
  return types.get(schema.id);
}

let indexed = 0;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  const type = typeOf(schema);
  const decoded = type.toObject(type.decode(message.data), { longs: String, enums: String, bytes: String, defaults: true });
  indexed++;
  console.log(JSON.stringify({
    topic: channel.topic, schema: schema.name, encoding: channel.messageEncoding,
    log_ns: String(message.logTime), publish_ns: String(message.publishTime), message: decoded,
  }));
}

const stream = new McapStreamReader({ validateCrcs: true, decompressHandlers });
stream.append(bytes);
let streamed = 0;
for (let record; (record = stream.nextRecord()); ) streamed += record.type === "Message" ? 1 : 0;
const metadata = {};
for await (const m of reader.readMetadata()) metadata[m.name] = Object.fromEntries(m.metadata);
console.log(JSON.stringify({
  indexed, streamed, done: stream.done(), counted: Number(reader.statistics.messageCount),
  chunks: reader.chunkIndexes.length, compression: reader.chunkIndexes[0]?.compression, metadata,
}));
