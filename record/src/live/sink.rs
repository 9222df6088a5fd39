//! Channels of a live stream: messages go to the clients that subscribed to their topics.

use super::server::LiveServer;
use crate::packet::Packet;
use crate::ros::{ENCODING, SCHEMA_ENCODING, Schema};
use crate::ros_writer::{MessageLifetime, MessageSink, RosWriter};
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteResult};
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, Context, PartialMetadata, RawChannel};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Shortest real time between two messages with the time of the stream. A client is disconnected if 1024 of them wait.
const TIME_INTERVAL: Duration = Duration::from_millis(30);

/// Sink of messages for clients.
pub(super) struct ClientSink {
    context: Arc<Context>,
    channels: Vec<ClientChannel>,
    held: Arc<HeldMessages>,
    /// Newest time of a message \[ns\].
    newest: u64,
}

struct ClientChannel {
    channel: Arc<RawChannel>,
    lifetime: MessageLifetime,
}

impl ClientSink {
    pub(super) fn new() -> Self {
        // The default context of the crate would be shared by all servers of a process.
        Self { context: Context::new(), channels: Vec::new(), held: Arc::default(), newest: 0 }
    }

    /// The channels, for the server.
    pub(super) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// The last messages of topics that later clients need too.
    pub(super) fn held(&self) -> Arc<HeldMessages> {
        Arc::clone(&self.held)
    }
}

impl MessageSink for ClientSink {
    fn add_channel(
        &mut self,
        topic: &str,
        schema: Schema,
        metadata: BTreeMap<String, String>,
        lifetime: MessageLifetime,
    ) -> io::Result<u16> {
        let id = u16::try_from(self.channels.len()).map_err(|_| io::Error::other("more than 65536 topics"))?;
        let definition = foxglove::Schema::new(schema.name(), SCHEMA_ENCODING, schema.text().into_bytes());
        let builder = self.context().channel_builder(topic).message_encoding(ENCODING).schema(definition);
        let channel = builder.metadata(metadata).build_raw().map_err(io::Error::other)?;
        self.channels.push(ClientChannel { channel, lifetime });
        Ok(id)
    }

    fn wants(&self, channel: u16) -> bool {
        let ClientChannel { channel, lifetime } = &self.channels[usize::from(channel)];
        *lifetime == MessageLifetime::UntilNext || channel.has_sinks()
    }

    fn write(&mut self, channel: u16, nanos: u64, data: &[u8]) -> io::Result<()> {
        self.newest = self.newest.max(nanos);
        let ClientChannel { channel, lifetime } = &self.channels[usize::from(channel)];
        match lifetime {
            MessageLifetime::Once => channel.log_with_meta(data, PartialMetadata::with_log_time(nanos)),
            MessageLifetime::UntilNext => self.held.write(channel, nanos, data),
        }
        Ok(())
    }
}

/// The last message of each topic with [`MessageLifetime::UntilNext`]. A client gets it when it subscribes.
#[derive(Default)]
pub(super) struct HeldMessages(Mutex<HashMap<ChannelId, HeldMessage>>);

struct HeldMessage {
    channel: Arc<RawChannel>,
    nanos: u64,
    data: Vec<u8>,
}

impl HeldMessages {
    fn write(&self, channel: &Arc<RawChannel>, nanos: u64, data: &[u8]) {
        let message = HeldMessage { channel: Arc::clone(channel), nanos, data: data.to_vec() };
        // A client that subscribes now waits for the lock, so that it gets no older message after this one.
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        channel.log_with_meta(data, PartialMetadata::with_log_time(nanos));
        held.insert(channel.id(), message);
    }
}

impl ServerListener for HeldMessages {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A message without a client goes to all of them.
        if let (Some(message), Some(client)) = (held.get(&channel.id()), client.sink_id()) {
            let HeldMessage { channel, nanos, data } = message;
            channel.log_with_meta_to_sink(data, PartialMetadata::with_log_time(*nanos), Some(client));
        }
    }
}

/// Writer of a live stream. The server stops with it.
pub(super) struct FoxgloveWriter {
    messages: RosWriter<ClientSink>,
    server: Arc<LiveServer>,
    time_sent: Instant,
}

impl FoxgloveWriter {
    pub(super) fn new(messages: RosWriter<ClientSink>, server: Arc<LiveServer>) -> Self {
        Self { messages, server, time_sent: Instant::now() }
    }
}

impl FormatWriter for FoxgloveWriter {
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        self.messages.write(streams, packet)?;
        if self.time_sent.elapsed() >= TIME_INTERVAL {
            self.time_sent = Instant::now();
            self.server.send_time(self.messages.sink.newest);
        }
        Ok(())
    }

    fn finish(&mut self, _: &[StreamSchema]) -> WriteResult<u64> {
        Ok(0)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        None
    }
}

impl Drop for FoxgloveWriter {
    fn drop(&mut self) {
        self.server.stop();
    }
}
