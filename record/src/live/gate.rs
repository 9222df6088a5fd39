//! Access to the server of a live stream.
//!
//! ```text
//! client -> Gate at the configured address -> server of the crate foxglove at a random address of 127.0.0.0/8
//! ```
//!
//! The server of the crate accepts every client, also pages of any website in a browser on this machine. The gate reads the
//! head of each request, refuses what the access policy refuses, and passes on the bytes of all other connections.

use kinetoscope_http::{AccessPolicy, RequestHead, Status, error_response};
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, copy, copy_bidirectional, sink};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{self, Runtime};
use tokio::sync::oneshot;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

/// Largest number of connections; further ones are closed without a response.
const MAX_CONNECTIONS: usize = 64;
/// Time after a failed attempt to accept a connection, for example for a lack of file descriptors.
const RETRY_INTERVAL: Duration = Duration::from_millis(15);
/// Time for the last messages when the server stops, and for the rest of a refused request.
const CLOSING_TIME: Duration = Duration::from_secs(1);

/// A listening gate. Dropping it stops listening at once; its connections have another second for their last messages.
#[derive(Debug)]
pub(super) struct Gate {
    stop: Option<oneshot::Sender<()>>,
    /// Disconnected when the gate no longer listens.
    closed: mpsc::Receiver<()>,
}

/// Destination and policy of connections.
#[derive(Debug)]
struct Passage {
    policy: AccessPolicy,
    server: SocketAddr,
}

impl Gate {
    /// Passes connections on to `server`, as far as `policy` accepts them.
    ///
    /// # Errors
    /// The operating system provides no thread or no event queue.
    pub(super) fn open(listener: std::net::TcpListener, policy: AccessPolicy, server: SocketAddr) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        let runtime = runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let (stop, stopped) = oneshot::channel();
        let (listening, closed) = mpsc::channel();
        let passage = Arc::new(Passage { policy, server });
        let run = move || run(&runtime, listener, &passage, stopped, listening);
        thread::Builder::new().name("foxglove-gate".into()).spawn(run)?;
        Ok(Self { stop: Some(stop), closed })
    }
}

impl Drop for Gate {
    fn drop(&mut self) {
        // Both fail only if the thread of the gate has ended.
        let _ = self.stop.take().map(|stop| stop.send(()));
        let _ = self.closed.recv();
    }
}

fn run(
    runtime: &Runtime,
    listener: std::net::TcpListener,
    passage: &Arc<Passage>,
    stopped: oneshot::Receiver<()>,
    listening: mpsc::Sender<()>,
) {
    runtime.block_on(async {
        let mut connections = JoinSet::new();
        match TcpListener::from_std(listener) {
            Ok(listener) => accept(&listener, passage, stopped, &mut connections).await,
            Err(error) => tracing::error!(target: "kinetoscope_record", %error, "the stream to Foxglove cannot listen"),
        }
        // The listener is closed.
        drop(listening);
        let _ = timeout(CLOSING_TIME, async { while connections.join_next().await.is_some() {} }).await;
    });
}

/// Accepts connections until the gate is closed.
async fn accept(
    listener: &TcpListener,
    passage: &Arc<Passage>,
    mut stopped: oneshot::Receiver<()>,
    connections: &mut JoinSet<()>,
) {
    loop {
        tokio::select! {
            _ = &mut stopped => return,
            Some(_) = connections.join_next() => {}
            accepted = listener.accept() => match accepted {
                Ok((client, _)) if connections.len() < MAX_CONNECTIONS => {
                    let passage = Arc::clone(passage);
                    // An error means that client or server ended the connection.
                    connections.spawn(async move { drop(passage.pass(client).await) });
                }
                Ok(_) => {}
                Err(_) => sleep(RETRY_INTERVAL).await,
            },
        }
    }
}

impl Passage {
    async fn pass(&self, mut client: TcpStream) -> io::Result<()> {
        client.set_nodelay(true)?;
        let read = timeout(RequestHead::READ_TIMEOUT, self.read_request(&mut client)).await;
        let request = match read.unwrap_or(Ok(Err(Status::Timeout)))? {
            Ok(request) => request,
            Err(status) => return refuse(client, status).await,
        };
        let mut server = TcpStream::connect(self.server).await?;
        server.set_nodelay(true)?;
        server.write_all(&request).await?;
        copy_bidirectional(&mut client, &mut server).await.map(drop)
    }

    /// Reads the first bytes of a connection until they contain a complete head that the policy accepts. The inner error is
    /// the status of a refusal.
    async fn read_request(&self, client: &mut TcpStream) -> io::Result<Result<Vec<u8>, Status>> {
        let mut bytes = Vec::new();
        loop {
            if client.read_buf(&mut bytes).await? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            let head = match RequestHead::parse(&bytes) {
                Ok(None) => continue,
                Ok(Some(head)) => head,
                Err(status) => return Ok(Err(status)),
            };
            if let Err(status) = self.policy.check(&head) {
                let origin = head.header("origin").ok().flatten();
                tracing::warn!(target: "kinetoscope_record", ?origin, "refused a client of the stream to Foxglove");
                return Ok(Err(status));
            }
            // A page can request an image from here without an origin, but no WebSocket.
            let upgrades = head.header_contains("upgrade", "websocket");
            return Ok(if upgrades { Ok(bytes) } else { Err(Status::UpgradeRequired) });
        }
    }
}

async fn refuse(mut client: TcpStream, status: Status) -> io::Result<()> {
    client.write_all(error_response(status, true).as_bytes()).await?;
    client.shutdown().await?;
    // Closing a socket with unread data would reset the connection and lose the response.
    let _ = timeout(CLOSING_TIME, copy(&mut client, &mut sink())).await;
    Ok(())
}
