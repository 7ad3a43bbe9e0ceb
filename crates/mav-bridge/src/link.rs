//! Bytes over UDP, TCP and serial ports: the thin tokio side of a bridge.
//!
//! A [`Link`] lives on through silence, refused connections and lost ones; what it cannot send
//! now it drops, for a command is repeated until it is answered and telemetry is soon stale.

use crate::BridgeError;
use serial2_tokio::SerialPort;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UdpSocket, lookup_host};
use tokio::sync::mpsc::{self, error::TrySendError};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};

/// Datagrams or pieces of a stream that may wait on either side.
const QUEUE: usize = 1024;
/// Notices that may wait for the owner.
const NOTICES: usize = 16;
/// Pause before the next attempt to connect.
const RECONNECT: Duration = Duration::from_secs(1);
/// Time to wait for a connection or for a peer that does not take what is sent to it.
const PEER_TIMEOUT: Duration = Duration::from_secs(5);
/// Largest piece read at once; a UDP datagram is at most this long.
const READ_BYTES: usize = 65_536;

/// Address of a link.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinkAddress {
    /// `udpin:HOST:PORT`: listens, and sends to every address from which it receives. A MAVLink system belongs
    /// to the address that sends it first; from another one it is ignored until that is silent for 5 s.
    UdpListen(String),
    /// `udpout:HOST:PORT`: sends to that address and listens to its answers.
    UdpConnect(String),
    /// `tcp:HOST:PORT`: connects, and again whenever the connection is lost.
    TcpConnect(String),
    /// `tcpin:HOST:PORT`: waits for a client, one at a time.
    TcpListen(String),
    /// `serial:PATH:BAUD`: a serial port such as `/dev/ttyUSB0`, opened again whenever it is lost.
    Serial(String, u32),
}

impl FromStr for LinkAddress {
    type Err = BridgeError;

    fn from_str(text: &str) -> Result<Self, BridgeError> {
        let bad = || BridgeError::BadLink(text.to_owned());
        let (kind, address) = text.split_once(':').ok_or_else(bad)?;
        let (host, port) = address.rsplit_once(':').ok_or_else(bad)?;
        if kind == "serial" {
            let baud = port
                .parse()
                .ok()
                .filter(|baud| *baud > 0 && !host.is_empty());
            return Ok(Self::Serial(host.to_owned(), baud.ok_or_else(bad)?));
        }
        if host.is_empty() || port.parse::<u16>().is_err() {
            return Err(bad());
        }
        let address = address.to_owned();
        match kind {
            "udpin" => Ok(Self::UdpListen(address)),
            "udpout" => Ok(Self::UdpConnect(address)),
            "tcp" => Ok(Self::TcpConnect(address)),
            "tcpin" => Ok(Self::TcpListen(address)),
            _ => Err(bad()),
        }
    }
}

impl fmt::Display for LinkAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UdpListen(a) => write!(f, "udpin:{a}"),
            Self::UdpConnect(a) => write!(f, "udpout:{a}"),
            Self::TcpConnect(a) => write!(f, "tcp:{a}"),
            Self::TcpListen(a) => write!(f, "tcpin:{a}"),
            Self::Serial(path, baud) => write!(f, "serial:{path}:{baud}"),
        }
    }
}

/// An open link. Closed when dropped.
#[derive(Debug)]
pub struct Link {
    incoming: mpsc::Receiver<Vec<u8>>,
    outgoing: mpsc::Sender<Vec<u8>>,
    notices: mpsc::Receiver<String>,
    task: JoinHandle<()>,
}

/// The task's ends of the two queues.
struct Ends {
    incoming: mpsc::Sender<Vec<u8>>,
    outgoing: mpsc::Receiver<Vec<u8>>,
    notices: mpsc::Sender<String>,
}

impl Link {
    /// Opens a link; must be called inside a tokio runtime. A TCP connection is made, and a serial port
    /// opened, in the background.
    ///
    /// # Errors
    /// [`BridgeError::Socket`] if the address cannot be resolved or bound.
    pub async fn open(address: &LinkAddress) -> Result<Self, BridgeError> {
        let (to_owner, incoming) = mpsc::channel(QUEUE);
        let (outgoing, from_owner) = mpsc::channel(QUEUE);
        let (to_tell, notices) = mpsc::channel(NOTICES);
        let ends = Ends {
            incoming: to_owner,
            outgoing: from_owner,
            notices: to_tell,
        };
        let refuse = |source| BridgeError::Socket {
            link: address.to_string(),
            source,
        };
        let task = match address {
            LinkAddress::UdpListen(at) => {
                let socket = UdpSocket::bind(at).await.map_err(refuse)?;
                tokio::spawn(udp_server(socket, ends))
            }
            LinkAddress::UdpConnect(to) => {
                let (socket, peer) = udp_towards(to).await.map_err(refuse)?;
                tokio::spawn(udp_client(socket, peer, ends))
            }
            LinkAddress::TcpConnect(to) => tokio::spawn(tcp_client(to.clone(), ends)),
            LinkAddress::TcpListen(at) => {
                let listener = TcpListener::bind(at).await.map_err(refuse)?;
                tokio::spawn(tcp_server(listener, ends))
            }
            LinkAddress::Serial(path, baud) => tokio::spawn(serial(path.clone(), *baud, ends)),
        };
        Ok(Self {
            incoming,
            outgoing,
            notices,
            task,
        })
    }

    /// The next bytes, when they come; none when the link has ended for good.
    pub async fn receive(&mut self) -> Option<Vec<u8>> {
        self.incoming.recv().await
    }

    /// The next bytes, if some have come.
    pub fn try_receive(&mut self) -> Option<Vec<u8>> {
        self.incoming.try_recv().ok()
    }

    /// The next notice about the link, such as an ignored sender; each once.
    pub fn try_notice(&mut self) -> Option<String> {
        self.notices.try_recv().ok()
    }

    /// Sends a frame; false if it was dropped because the link does not keep up.
    pub fn send(&self, frame: Vec<u8>) -> bool {
        self.outgoing.try_send(frame).is_ok()
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Ends {
    /// Hands bytes to the owner; false once the owner has gone.
    fn deliver(&self, bytes: &[u8]) -> bool {
        match self.incoming.try_send(bytes.to_vec()) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                tracing::warn!("{} bytes dropped: the receiving queue is full", bytes.len());
                true
            }
            Err(TrySendError::Closed(_)) => false,
        }
    }
}

async fn udp_towards(to: &str) -> std::io::Result<(UdpSocket, SocketAddr)> {
    let not_found = || std::io::Error::new(std::io::ErrorKind::NotFound, "no such host");
    let peer = lookup_host(to).await?.next().ok_or_else(not_found)?;
    let any = if peer.is_ipv4() {
        "0.0.0.0:0"
    } else {
        "[::]:0"
    };
    Ok((UdpSocket::bind(any).await?, peer))
}

/// The MAVLink system that a datagram comes from, by the header of its first frame.
fn system_of(datagram: &[u8]) -> Option<u8> {
    match datagram.first()? {
        0xFD => datagram.get(5).copied(),
        0xFE => datagram.get(3).copied(),
        _ => None,
    }
}

/// Senders to a UDP port. Each MAVLink system belongs to one address, so that no other sender can speak in the name
/// of a received vehicle; bytes that are no frames count as one more system.
#[derive(Debug, Default)]
struct Peers {
    by_system: BTreeMap<Option<u8>, (SocketAddr, Instant)>,
    /// Ignored senders that were reported.
    ignored: BTreeSet<(Option<u8>, SocketAddr)>,
}

/// Most ignored senders that are reported: addresses can be forged.
const MOST_IGNORED: usize = 16;

impl Peers {
    /// Whether a datagram from an address is accepted; else a notice, once for each sender.
    fn hears(
        &mut self,
        datagram: &[u8],
        from: SocketAddr,
        now: Instant,
    ) -> Result<(), Option<String>> {
        let system = system_of(datagram);
        let owner = self.by_system.get(&system).copied();
        if let Some((owner, heard)) = owner.filter(|(owner, _)| *owner != from)
            && now.duration_since(heard) < PEER_TIMEOUT
        {
            let new = self.ignored.len() < MOST_IGNORED && self.ignored.insert((system, from));
            let what = system.map_or_else(
                || "bytes that are no MAVLink".to_owned(),
                |system| format!("system {system}"),
            );
            return Err(new.then(|| {
                format!(
                    "{from} is ignored: it sends {what}, which {owner} sends too; expected another system id of one of them"
                )
            }));
        }
        if owner.is_none_or(|(owner, _)| owner != from) {
            tracing::info!("vehicle link: receiving from {from}");
        }
        self.by_system.insert(system, (from, now));
        Ok(())
    }

    /// Every address from which datagrams were accepted.
    fn addresses(&self) -> BTreeSet<SocketAddr> {
        self.by_system
            .values()
            .map(|(address, _)| *address)
            .collect()
    }
}

/// Pause after an error of a UDP socket: a datagram refused by its receiver shows as one on the next call.
const AFTER_REFUSAL: Duration = Duration::from_millis(10);

async fn send_to(socket: &UdpSocket, frame: &[u8], to: SocketAddr) {
    if let Err(error) = socket.send_to(frame, to).await {
        tracing::debug!("vehicle link: {to}: {error}");
    }
}

/// Serves a UDP socket: receives from all senders and sends to them.
async fn udp_server(socket: UdpSocket, mut ends: Ends) {
    let mut peers = Peers::default();
    let mut buffer = vec![0; READ_BYTES];
    loop {
        tokio::select! {
            received = socket.recv_from(&mut buffer) => {
                let Ok((length, from)) = received else {
                    sleep(AFTER_REFUSAL).await;
                    continue;
                };
                match peers.hears(&buffer[..length], from, Instant::now()) {
                    Ok(()) => {
                        if !ends.deliver(&buffer[..length]) {
                            return;
                        }
                    }
                    Err(notice) => {
                        if let Some(notice) = notice {
                            let _ = ends.notices.try_send(notice);
                        }
                    }
                }
            }
            frame = ends.outgoing.recv() => {
                let Some(frame) = frame else { return };
                for to in peers.addresses() {
                    send_to(&socket, &frame, to).await;
                }
            }
        }
    }
}

/// Serves a UDP socket: to and from `peer` alone.
async fn udp_client(socket: UdpSocket, peer: SocketAddr, mut ends: Ends) {
    let mut buffer = vec![0; READ_BYTES];
    loop {
        tokio::select! {
            received = socket.recv_from(&mut buffer) => match received {
                Ok((length, from)) if from == peer => {
                    if !ends.deliver(&buffer[..length]) {
                        return;
                    }
                }
                Ok(_) => {}
                Err(_) => sleep(AFTER_REFUSAL).await,
            },
            frame = ends.outgoing.recv() => {
                let Some(frame) = frame else { return };
                send_to(&socket, &frame, peer).await;
            }
        }
    }
}

async fn tcp_client(to: String, mut ends: Ends) {
    let mut refused = false;
    loop {
        match timeout(PEER_TIMEOUT, TcpStream::connect(&to)).await {
            Ok(Ok(stream)) => {
                tracing::info!("vehicle link: connected to {to}");
                refused = false;
                if !tcp(stream, &mut ends).await {
                    return;
                }
                tracing::warn!("vehicle link: lost {to}, reconnecting");
            }
            failed => {
                if !std::mem::replace(&mut refused, true) {
                    let why = match failed {
                        Ok(Err(error)) => error.to_string(),
                        _ => "no answer".to_owned(),
                    };
                    tracing::warn!("vehicle link: {to}: {why}; retrying");
                }
            }
        }
        if ends.incoming.is_closed() {
            return;
        }
        drop_stale(&mut ends);
        sleep(RECONNECT).await;
        drop_stale(&mut ends);
    }
}

async fn serial(path: String, baud: u32, mut ends: Ends) {
    let mut refused = false;
    while !ends.incoming.is_closed() {
        match SerialPort::open(&path, baud) {
            Ok(port) => {
                tracing::info!("vehicle link: {path} open at {baud} baud");
                refused = false;
                drop_stale(&mut ends);
                let (reader, writer) = tokio::io::split(port);
                if !stream(reader, writer, &mut ends).await {
                    return;
                }
                tracing::warn!("vehicle link: lost {path}, reopening");
            }
            Err(error) => {
                if !std::mem::replace(&mut refused, true) {
                    tracing::warn!("vehicle link: {path}: {error}; retrying");
                }
            }
        }
        sleep(RECONNECT).await;
    }
}

async fn tcp_server(listener: TcpListener, mut ends: Ends) {
    while !ends.incoming.is_closed() {
        if let Ok((stream, from)) = listener.accept().await {
            tracing::info!("vehicle link: {from} connected");
            drop_stale(&mut ends);
            if !tcp(stream, &mut ends).await {
                return;
            }
            tracing::info!("vehicle link: {from} disconnected");
        } else {
            sleep(RECONNECT).await;
        }
    }
}

/// Drops frames queued while no peer was known.
fn drop_stale(ends: &mut Ends) {
    while ends.outgoing.try_recv().is_ok() {}
}

/// Serves one TCP connection to its end; false once the owner has gone.
async fn tcp(connection: TcpStream, ends: &mut Ends) -> bool {
    // Frames are small and wanted now.
    let _ = connection.set_nodelay(true);
    let (reader, writer) = connection.into_split();
    stream(reader, writer, ends).await
}

/// Serves a stream of bytes to its end; false once the owner has gone.
async fn stream(
    mut reader: impl AsyncRead + Unpin,
    mut writer: impl AsyncWrite + Unpin,
    ends: &mut Ends,
) -> bool {
    let mut buffer = vec![0; READ_BYTES];
    loop {
        tokio::select! {
            read = reader.read(&mut buffer) => match read {
                Ok(0) | Err(_) => return true,
                Ok(length) => {
                    if !ends.deliver(&buffer[..length]) {
                        return false;
                    }
                }
            },
            frame = ends.outgoing.recv() => {
                let Some(frame) = frame else { return false };
                match timeout(PEER_TIMEOUT, writer.write_all(&frame)).await {
                    Ok(Ok(())) => {}
                    _ => return true,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_as_people_write_them() {
        for text in [
            "udpin:0.0.0.0:14550",
            "udpout:192.168.1.7:14550",
            "tcp:localhost:5760",
            "tcpin:[::1]:5760",
            "serial:/dev/ttyUSB0:57600",
            "serial:COM3:115200",
        ] {
            let address: LinkAddress = text.parse().unwrap();
            assert_eq!(address.to_string(), text);
        }
        for text in [
            "",
            "udp:1.2.3.4:1",
            "tcp:5760",
            "tcp::5760",
            "udpin:host:99999",
            "serial:/dev/ttyUSB0",
            "serial:/dev/ttyUSB0:0",
            "serial::57600",
        ] {
            let error = text.parse::<LinkAddress>().unwrap_err().to_string();
            assert!(error.contains("expected udpin:"), "{error}");
        }
    }

    async fn soon(link: &mut Link) -> Vec<u8> {
        timeout(Duration::from_secs(5), link.receive())
            .await
            .unwrap()
            .unwrap()
    }

    /// A link that listens for datagrams at a port that was free.
    async fn listening() -> (Link, u16) {
        let probe = UdpSocket::bind("127.0.0.1:0").await.unwrap();
        let port = probe.local_addr().unwrap().port();
        drop(probe);
        let at = format!("udpin:127.0.0.1:{port}").parse().unwrap();
        (Link::open(&at).await.unwrap(), port)
    }

    #[tokio::test]
    async fn udp_both_ways_and_no_stranger() {
        let (mut here, port) = listening().await;
        let to: LinkAddress = format!("udpout:127.0.0.1:{port}").parse().unwrap();
        let mut vehicle = Link::open(&to).await.unwrap();
        assert!(vehicle.send(vec![1, 2, 3]));
        assert_eq!(soon(&mut here).await, [1, 2, 3]);
        here.send(vec![4]);
        assert_eq!(soon(&mut vehicle).await, [4]);
        let stranger = Link::open(&to).await.unwrap();
        stranger.send(vec![66]);
        sleep(Duration::from_millis(50)).await;
        vehicle.send(vec![5]);
        assert_eq!(soon(&mut here).await, [5]);
    }

    /// A frame of a system, as far as a link looks at it: MAVLink 2, and the system in its sixth byte.
    fn of_system(system: u8) -> Vec<u8> {
        vec![0xFD, 0, 0, 0, 0, system, 1, 0, 0, 0]
    }

    #[tokio::test]
    async fn two_aircraft_at_one_port_are_both_heard_and_both_answered() {
        let (mut here, port) = listening().await;
        let to: LinkAddress = format!("udpout:127.0.0.1:{port}").parse().unwrap();
        let mut first = Link::open(&to).await.unwrap();
        let mut second = Link::open(&to).await.unwrap();
        for _ in 0..2 {
            for (vehicle, system) in [(&first, 5), (&second, 6)] {
                vehicle.send(of_system(system));
                assert_eq!(soon(&mut here).await, of_system(system));
            }
        }
        here.send(of_system(255));
        assert_eq!(soon(&mut first).await, of_system(255));
        assert_eq!(soon(&mut second).await, of_system(255));
        assert_eq!(here.try_notice(), None);
        // A third that calls itself 5 is ignored, which is told once.
        let third = Link::open(&to).await.unwrap();
        third.send(of_system(5));
        third.send(of_system(5));
        sleep(Duration::from_millis(50)).await;
        first.send(of_system(5));
        assert_eq!(soon(&mut here).await, of_system(5));
        assert!(here.try_receive().is_none());
        let notice = here.try_notice().unwrap();
        assert!(notice.contains("sends system 5"), "{notice}");
        assert_eq!(here.try_notice(), None);
    }

    /// A pseudo-terminal stands in for a radio at its port.
    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn a_serial_port_both_ways_whatever_the_bytes() {
        use std::os::fd::AsRawFd as _;
        let (radio, port) = serial2::SerialPort::pair().unwrap();
        let address = format!("serial:/proc/self/fd/{}:57600", port.as_raw_fd());
        let mut link = Link::open(&address.parse().unwrap()).await.unwrap();
        // The bytes that a terminal would make something else of are among them.
        let all: Vec<u8> = (0..=255).collect();
        radio.write_all(&all).unwrap();
        let mut back = Vec::new();
        while back.len() < 256 {
            back.extend(soon(&mut link).await);
        }
        assert_eq!(back, all);
        link.send(all.clone());
        let heard = tokio::task::spawn_blocking(move || {
            let mut heard = vec![0; 256];
            radio.read_exact(&mut heard).unwrap();
            heard
        });
        let heard = timeout(Duration::from_secs(5), heard).await;
        assert_eq!(heard.unwrap().unwrap(), all);
    }

    #[tokio::test]
    async fn tcp_connects_again() {
        let port = {
            let probe = TcpListener::bind("127.0.0.1:0").await.unwrap();
            probe.local_addr().unwrap().port()
        };
        // Nobody listens yet: the client keeps trying.
        let mut client = Link::open(&format!("tcp:127.0.0.1:{port}").parse().unwrap())
            .await
            .unwrap();
        sleep(Duration::from_millis(100)).await;
        for round in 0..2 {
            let at = format!("tcpin:127.0.0.1:{port}").parse().unwrap();
            let mut server = Link::open(&at).await.unwrap();
            // Sent until it arrives: what is sent while nobody is there is dropped.
            let mut heard = None;
            for _ in 0..100 {
                client.send(vec![round]);
                heard = timeout(Duration::from_millis(50), server.receive())
                    .await
                    .ok();
                if heard.is_some() {
                    break;
                }
            }
            assert_eq!(heard.unwrap().unwrap()[0], round);
            server.send(vec![9]);
            assert_eq!(soon(&mut client).await, [9]);
            drop(server);
            sleep(Duration::from_millis(50)).await;
        }
    }

    #[tokio::test]
    async fn a_taken_port_is_refused_with_its_name() {
        let first = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = first.local_addr().unwrap().port();
        let again = format!("tcpin:127.0.0.1:{port}").parse().unwrap();
        let error = Link::open(&again).await.unwrap_err().to_string();
        assert!(error.contains(&port.to_string()), "{error}");
    }
}
