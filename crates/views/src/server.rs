//! How the page, Foxglove and metrics are served: HTTP/1.1 with a bounded number of connections, none of which may be
//! held without a request, or without reading the answer.
//!
//! `axum::serve` has none of these limits, hence the loop here over hyper, on which axum stands.

use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_core::future::BoxFuture;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio_io_timeout::TimeoutStream;

/// Time before the next connection is accepted where the system has no file left for one.
const NO_FILE: Duration = Duration::from_millis(200);
/// Longest request without a page behind it, bytes: the least that hyper reads.
const SHORT_REQUEST_BYTES: usize = 8192;

/// How much of this process a server may occupy.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Connections at a time.
    pub connections: usize,
    /// How long a request may take to arrive, and a connection may stay without one.
    pub request_within: Duration,
    /// How long the other side may read nothing of what is sent to it.
    pub reads_within: Duration,
    /// How long a connection may last with its one request and answer; without it, a connection serves many.
    pub closed_within: Option<Duration>,
}

/// Serves `app` until `end` is ready, and then the connections that are still being answered.
pub(crate) async fn serve(
    listener: TcpListener,
    app: Router,
    limits: Limits,
    end: impl Future<Output = ()>,
) {
    tokio::pin!(end);
    let places = Arc::new(Semaphore::new(limits.connections));
    let (closing, closes) = watch::channel(());
    let mut connections = JoinSet::new();
    loop {
        let next = async {
            let place = Arc::clone(&places).acquire_owned().await.ok()?;
            match listener.accept().await {
                Ok((stream, _)) => Some((stream, place)),
                Err(_) => {
                    tokio::time::sleep(NO_FILE).await;
                    None
                }
            }
        };
        tokio::select! {
            () = &mut end => break,
            next = next => if let Some((stream, place)) = next {
                connections.spawn(connection(stream, place, app.clone(), limits, closes.clone()));
            },
            Some(_) = connections.join_next() => {}
        }
    }
    drop(closing);
    while connections.join_next().await.is_some() {}
}

/// Serves one connection until it ends, exceeds its limits, or the server closes.
async fn connection(
    stream: TcpStream,
    _place: OwnedSemaphorePermit,
    app: Router,
    limits: Limits,
    mut closes: watch::Receiver<()>,
) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(limits.request_within);
    if limits.closed_within.is_some() {
        http.keep_alive(false).max_buf_size(SHORT_REQUEST_BYTES);
    }
    // Without a time limit a client that requests and does not read would keep its connection.
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(limits.reads_within));
    let stream = TokioIo::new(Box::pin(stream));
    let served = http
        .serve_connection(stream, TowerToHyperService::new(app))
        .with_upgrades();
    tokio::pin!(served);
    let expires = async {
        match limits.closed_within {
            Some(within) => tokio::time::sleep(within).await,
            None => std::future::pending().await,
        }
    };
    // What is wrong with a connection is the other side's business.
    tokio::select! {
        _ = &mut served => {}
        () = expires => {}
        _ = closes.changed() => {
            served.as_mut().graceful_shutdown();
            let _ = served.await;
        }
    }
}

/// Serves the text that `text` makes at one path, of a media type, for as long as the runtime lives.
pub fn serve_text(
    listener: TcpListener,
    (path, media_type): (&'static str, &'static str),
    limits: Limits,
    text: impl Fn() -> String + Send + Sync + 'static,
) -> BoxFuture<'static, ()> {
    let text = Arc::new(text);
    let answer = move || {
        let text = text();
        async move { ([(header::CONTENT_TYPE, media_type)], text) }
    };
    let elsewhere =
        move || async move { (StatusCode::NOT_FOUND, format!("expected GET {path}\n")) };
    let app = Router::new().route(path, get(answer)).fallback(elsewhere);
    Box::pin(serve(listener, app, limits, std::future::pending()))
}

/// Rejects requests that name this server by anything but an address or `localhost`: against DNS
/// rebinding, by which a page from elsewhere makes a name of its own resolve to this machine and is
/// then of the same origin as this server.
pub(crate) async fn only_by_address(request: Request, next: Next) -> Response {
    match host(request.headers()).filter(|h| is_address(h)) {
        Some(_) => next.run(request).await,
        None => (
            StatusCode::FORBIDDEN,
            "open this server by its address, such as 127.0.0.1, not by a name\n",
        )
            .into_response(),
    }
}

/// The host that a request names, with its port.
pub(crate) fn host(headers: &HeaderMap) -> Option<&str> {
    headers.get(header::HOST).and_then(|h| h.to_str().ok())
}

/// Whether `host` (with or without port) is an address or `localhost`, not a name that somebody
/// else may point here.
pub(crate) fn is_address(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_names() {
        for host in [
            "127.0.0.1:8787",
            "localhost",
            "LOCALHOST:1",
            "[::1]:80",
            "192.168.1.4:80",
        ] {
            assert!(is_address(host), "{host}");
        }
        for host in [
            "evil.example",
            "evil.example:8787",
            "localhost.evil.example:8787",
            "",
        ] {
            assert!(!is_address(host), "{host}");
        }
    }
}
