//! Vehicles shown by FlightGear: one packet fifty times a second over UDP.

use crate::Failure;
use anyhow::Context as _;
use mission::Member;
use std::net::{ToSocketAddrs as _, UdpSocket};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Time between two packets: FlightGear is started with `socket,in,50,…`.
const PERIOD: Duration = Duration::from_millis(20);

/// A FlightGear that shows one vehicle.
#[derive(Debug)]
pub struct Viewer {
    socket: UdpSocket,
    next: Instant,
}

impl Viewer {
    /// A viewer at `HOST:PORT`.
    ///
    /// # Errors
    /// An invalid address.
    pub fn open(address: &str) -> Result<Self, Failure> {
        let to = address
            .to_socket_addrs()
            .with_context(|| format!("--flightgear {address}: expected HOST:PORT"))
            .map_err(Failure::Input)?
            .next()
            .ok_or_else(|| Failure::usage(format!("--flightgear {address}: no such host")))?;
        let from = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(from).context("cannot open a socket for FlightGear")?;
        socket.connect(to).context("cannot reach FlightGear")?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            next: Instant::now(),
        })
    }

    /// Shows the vehicle as it is now, if a packet is due.
    pub fn show(&mut self, member: &Member) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        // Ticks come a little early and late: the rate is kept in the mean, gaps are not made up.
        self.next = (self.next + PERIOD).max(now - PERIOD / 2);
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let unix_time_s = since_1970.map_or(0, |d| u32::try_from(d.as_secs()).unwrap_or(u32::MAX));
        if let Some(packet) = member.aircraft().and_then(|a| a.net_fdm(unix_time_s)) {
            // A FlightGear that is not there yet, or not any more, is no failure of the flight.
            let _ = self.socket.send(&packet);
        }
    }
}

/// Reads `--flightgear` arguments, `ID=HOST:PORT` or, where the process has one vehicle,
/// `HOST:PORT`, for the vehicles `ids`; a scenario's own address stands where none is given.
///
/// # Errors
/// A vehicle that is not among `ids`.
pub fn addresses(
    arguments: &[String],
    ids: &[&str],
    scenario: &scenario::Scenario,
) -> Result<Vec<Option<String>>, Failure> {
    let of_scenario = |id: &&str| {
        let vehicle = scenario.vehicles.iter().find(|v| v.id == **id);
        vehicle.and_then(|v| v.flightgear.clone())
    };
    let mut addresses: Vec<Option<String>> = ids.iter().map(of_scenario).collect();
    for argument in arguments {
        let (id, address) = match (argument.split_once('='), ids) {
            (Some(pair), _) => pair,
            (None, [only]) => (*only, argument.as_str()),
            (None, _) => {
                return Err(Failure::usage(format!(
                    "--flightgear {argument}: expected ID=HOST:PORT, since this process has several vehicles"
                )));
            }
        };
        let place = ids.iter().position(|known| *known == id).ok_or_else(|| {
            Failure::usage(format!(
                "--flightgear {argument}: no vehicle '{id}' in this process; expected one of {}",
                ids.join(", ")
            ))
        })?;
        addresses[place] = Some(address.to_owned());
    }
    Ok(addresses)
}
