//! Figures of a long-running process for Prometheus, as text over HTTP (`--metrics ADDR`).

use crate::{Failure, runtime};
use mission::Setup;
use net::Net;
use protocol::SimTime;
use std::fmt::{Display, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use views::server::{self, Limits};

/// One Prometheus asks every few seconds, and nobody may take the handles that outputs need.
const LIMITS: Limits = Limits {
    connections: 8,
    request_within: Duration::from_secs(5),
    reads_within: Duration::from_secs(5),
    closed_within: Some(Duration::from_secs(5)),
};

/// Where Prometheus looks.
const PATH: &str = "/metrics";
/// What Prometheus calls its text format.
const TEXT_FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";

/// Figures in Prometheus's text format, as they are collected.
#[derive(Debug, Default)]
pub struct Text(String);

impl Text {
    /// A figure that only rises, or one that goes both ways, with its value for each set of labels.
    pub fn figure<L: Display, V: Display>(
        &mut self,
        (name, kind, help): (&str, &str, &str),
        values: impl IntoIterator<Item = (L, V)>,
    ) {
        // Writing into a string never fails.
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
        for (labels, value) in values {
            let _ = writeln!(self.0, "{name}{labels} {value}");
        }
    }

    /// A figure without labels.
    pub fn plain(&mut self, about: (&str, &str, &str), value: impl Display) {
        self.figure(about, [("", value)]);
    }
}

/// Serves what `collect` gives at `address` for as long as the runtime lives.
///
/// # Errors
/// An invalid address, or one in use.
pub async fn serve(
    address: &str,
    collect: impl Fn(&mut Text) + Send + Sync + 'static,
) -> Result<(), Failure> {
    let refuse = |why: std::io::Error| {
        Failure::usage(format!(
            "--metrics {address}: {why}; expected an address of this host, such as 127.0.0.1:9100"
        ))
    };
    let listener = TcpListener::bind(address).await.map_err(refuse)?;
    eprintln!("metrics: http://{}{PATH}", listener.local_addr()?);
    let text = move || {
        let mut text = Text::default();
        collect(&mut text);
        text.0
    };
    tokio::spawn(server::serve_text(
        listener,
        (PATH, TEXT_FORMAT),
        LIMITS,
        text,
    ));
    Ok(())
}

/// Figures of a mission in one process, on a thread of their own.
#[derive(Debug, Default)]
pub struct OfRun {
    time_ns: AtomicI64,
    messages: AtomicU64,
}

impl OfRun {
    /// Serves them at `address` for as long as the program runs.
    ///
    /// # Errors
    /// As [`serve`].
    pub fn serve(address: &str) -> Result<Arc<Self>, Failure> {
        let figures = Arc::new(Self::default());
        let shown = Arc::clone(&figures);
        let runtime = runtime::start("metrics", 1)?;
        runtime.block_on(serve(address, move |text| {
            let time_ns = shown.time_ns.load(Ordering::Relaxed);
            text.plain(
                (
                    "plumage_mission_seconds",
                    "gauge",
                    "Simulated time of the mission.",
                ),
                time_ns as f64 * 1e-9,
            );
            text.plain(
                (
                    "plumage_messages_said_total",
                    "counter",
                    "Messages that agents published.",
                ),
                shown.messages.load(Ordering::Relaxed),
            );
        }))?;
        runtime::keep(runtime);
        Ok(figures)
    }

    /// Takes in a tick in which so many messages were said.
    pub fn take(&self, now: SimTime, messages: usize) {
        self.time_ns.store(now.ns(), Ordering::Relaxed);
        self.messages.fetch_add(messages as u64, Ordering::Relaxed);
    }
}

/// Serves what a process on the bus of a mission knows of it.
///
/// # Errors
/// As [`serve`].
pub async fn serve_of_bus(address: &str, net: &Net, setup: &Setup) -> Result<(), Failure> {
    let (figures, presence) = (net.figures(), net.presence());
    let team = mission::team::agent_ids(setup).map_err(Failure::input)?;
    let team: Vec<String> = team.iter().map(ToString::to_string).collect();
    let begun = Instant::now();
    serve(address, move |text| {
        text.plain(
            (
                "plumage_up_seconds",
                "counter",
                "Time since this process joined the bus.",
            ),
            format!("{:.1}", begun.elapsed().as_secs_f64()),
        );
        let present = presence.now();
        let here = present.iter().map(|id| (id.as_str(), 1));
        let absent = team.iter().filter(|id| !present.contains(*id));
        let label = |(id, value): (&str, u8)| (format!("{{agent=\"{id}\"}}"), value);
        text.figure(
            (
                "plumage_present",
                "gauge",
                "1 for an agent that is present on the bus, 0 for a missing one of the team.",
            ),
            here.chain(absent.map(|id| (id.as_str(), 0))).map(label),
        );
        text.figure(
            (
                "plumage_missing_seconds",
                "gauge",
                "Time since the last heartbeat of a known agent that is missing.",
            ),
            presence.gone().into_iter().map(|(id, since)| {
                (
                    format!("{{agent=\"{id}\"}}"),
                    format!("{:.1}", since.elapsed().as_secs_f64()),
                )
            }),
        );
        text.plain(
            (
                "plumage_messages_heard_total",
                "counter",
                "Messages received.",
            ),
            figures.heard(),
        );
        text.plain(
            (
                "plumage_messages_refused_total",
                "counter",
                "Messages received and rejected.",
            ),
            figures.refused(),
        );
        text.plain(
            (
                "plumage_messages_said_total",
                "counter",
                "Messages published.",
            ),
            figures.said(),
        );
        text.plain(
            (
                "plumage_connections_lost_total",
                "counter",
                "Connections to other processes that were lost.",
            ),
            figures.lost(),
        );
    })
    .await
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpStream;

    #[tokio::test]
    async fn figures_are_read_over_http_and_nothing_else_is() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        drop(listener);
        let collect = |text: &mut Text| {
            text.figure(
                ("x_present", "gauge", "Who."),
                [("{agent=\"va/1\"}", 1), ("{agent=\"va/2\"}", 0)],
            );
            text.plain(("x_total", "counter", "How many."), 7);
        };
        serve(&address.to_string(), collect).await.unwrap();
        // As many as may read say nothing: they are dropped in time.
        let mut silent = Vec::new();
        for _ in 0..LIMITS.connections {
            silent.push(TcpStream::connect(address).await.unwrap());
        }
        let ask = async |request: &str| {
            let mut stream = TcpStream::connect(address).await.unwrap();
            stream.write_all(request.as_bytes()).await.unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).await.unwrap();
            answer
        };
        let answer = ask("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n").await;
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
        // Prometheus's exposition format, version 0.0.4.
        let body = "# HELP x_present Who.\n# TYPE x_present gauge\nx_present{agent=\"va/1\"} 1\n\
                    x_present{agent=\"va/2\"} 0\n# HELP x_total How many.\n# TYPE x_total counter\nx_total 7\n";
        assert!(answer.ends_with(body), "{answer}");
        let answer = ask("GET / HTTP/1.1\r\n\r\n").await;
        assert!(answer.starts_with("HTTP/1.1 404 "), "{answer}");
    }
}
