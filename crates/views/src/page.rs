//! The page: a web server that shows a running mission and takes its pause and speed buttons.
//!
//! Everything the page needs comes from this program. It answers only requests that name it by
//! an address or `localhost`, so that a web site cannot reach it under a name of its own (DNS
//! rebinding), and takes commands only from pages that it served itself.

use crate::ViewError;
use crate::live::LiveState;
use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use protocol::key::Name;
use protocol::message::{Control, ControlWish};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, watch};

/// Where the page is if nobody says otherwise.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8787";
/// Shortest time between two frames.
const FRAME: Duration = Duration::from_millis(200);
/// Longest command that is read, bytes.
const LONGEST_COMMAND: usize = 256;

/// What somebody at the page asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum PageCommand {
    /// Hold the mission.
    Pause,
    /// Let it go on.
    Resume,
    /// Simulated over wall time: 1 is real time, infinite is as fast as the processor allows.
    Speed(f64),
    /// The vehicle of this id is taken over or handed back.
    Control(String, Control),
    /// All vehicles come home.
    Home,
}

impl PageCommand {
    /// Reads a command of the page: `{"command":"pause"}`, `{"command":"resume"}` or
    /// `{"command":"speed","factor":10}`, factor null for as fast as possible;
    /// `{"command":"hand-back","vehicle":"3"}`, `{"command":"take-over","vehicle":"3"}`;
    /// `{"command":"home"}` for all vehicles.
    fn parse(text: &str) -> Option<Self> {
        let value: serde_json::Value = serde_json::from_str(text).ok()?;
        match value.get("command")?.as_str()? {
            "pause" => Some(Self::Pause),
            "resume" => Some(Self::Resume),
            "home" => Some(Self::Home),
            "speed" => match value.get("factor") {
                None | Some(serde_json::Value::Null) => Some(Self::Speed(f64::INFINITY)),
                Some(factor) => {
                    let factor = factor.as_f64()?;
                    (0.01..=1e4)
                        .contains(&factor)
                        .then_some(Self::Speed(factor))
                }
            },
            wish @ ("hand-back" | "take-over") => {
                let vehicle = value.get("vehicle")?.as_str()?;
                Name::new(vehicle).ok()?;
                let wish = match wish {
                    "hand-back" => ControlWish::HandBack,
                    _ => ControlWish::TakeOver,
                };
                let control = Control { wish, sticks: None };
                Some(Self::Control(vehicle.to_owned(), control))
            }
            _ => None,
        }
    }
}

#[derive(Clone)]
struct Shared {
    site: Arc<str>,
    frame: watch::Receiver<Arc<str>>,
    commands: mpsc::Sender<PageCommand>,
}

/// Listens at `address`.
///
/// # Errors
/// The address is in use or not to be had.
pub async fn listen(address: &str) -> Result<TcpListener, ViewError> {
    TcpListener::bind(address)
        .await
        .map_err(|source| ViewError::Address {
            address: address.to_owned(),
            source,
        })
}

/// Serves the page on `listener` until the sender of `live` is gone and the last frame is
/// shown; what people ask for goes to `commands`.
///
/// # Errors
/// The server fails.
pub async fn serve(
    listener: TcpListener,
    live: watch::Receiver<Arc<LiveState>>,
    commands: mpsc::Sender<PageCommand>,
) -> Result<(), ViewError> {
    let first = live.borrow().clone();
    // A watch channel keeps the newest frame only: a slow browser misses frames, and holds up neither
    // the run nor other browsers. A frame is made once, however many look.
    let (frame, frames) = watch::channel::<Arc<str>>(first.to_json().into());
    let shared = Shared {
        site: first.site().json().to_string().into(),
        frame: frames,
        commands,
    };
    let app = Router::new()
        .route(
            "/",
            get(|| async { html(include_str!("../assets/page.html")) }),
        )
        .route(
            "/page.css",
            get(|| async { css(include_str!("../assets/page.css")) }),
        )
        .route(
            "/page.js",
            get(|| async { js(include_str!("../assets/page.js")) }),
        )
        .route("/plotly.js", get(|| async { js(crate::plotly_js::text()) }))
        .route("/site.json", get(site))
        .route("/live", get(socket))
        .layer(middleware::from_fn(only_by_address))
        .with_state(shared);
    let drawing = tokio::spawn(draw(live, frame));
    let served = axum::serve(listener, app)
        .with_graceful_shutdown(async {
            // A panic in the drawing ends the page as well.
            let _ = drawing.await;
        })
        .await;
    served.map_err(ViewError::Server)
}

/// Turns states into frames, no more often than anybody can see.
async fn draw(mut live: watch::Receiver<Arc<LiveState>>, frame: watch::Sender<Arc<str>>) {
    while live.changed().await.is_ok() {
        let state = live.borrow_and_update().clone();
        frame.send_replace(state.to_json().into());
        tokio::time::sleep(FRAME).await;
    }
}

fn asset(kind: &'static str, text: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text).into_response()
}

fn html(text: &'static str) -> Response {
    let mut response = asset("text/html; charset=utf-8", text);
    // Nothing from elsewhere is loaded, and nobody may frame the page to steal clicks.
    let policy = "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: \
                  blob:; frame-ancestors 'none'";
    let value = header::HeaderValue::from_static(policy);
    let name = header::CONTENT_SECURITY_POLICY;
    response.headers_mut().insert(name, value);
    response
}

fn css(text: &'static str) -> Response {
    asset("text/css; charset=utf-8", text)
}

fn js(text: &'static str) -> Response {
    asset("text/javascript; charset=utf-8", text)
}

async fn site(State(shared): State<Shared>) -> Response {
    let headers = [(header::CONTENT_TYPE, "application/json")];
    (headers, shared.site.to_string()).into_response()
}

/// Refuses requests that name this server by anything but an address or `localhost`: against DNS
/// rebinding, by which a page from elsewhere makes a name of its own resolve to this machine and is
/// then of the same origin as this server.
async fn only_by_address(request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST);
    match host.and_then(|h| h.to_str().ok()).filter(|h| is_address(h)) {
        Some(_) => next.run(request).await,
        None => (
            StatusCode::FORBIDDEN,
            "open this page by its address, such as http://127.0.0.1:8787\n",
        )
            .into_response(),
    }
}

/// Whether `host` (with or without port) is an address or `localhost`, not a name that somebody
/// else may point here.
fn is_address(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok()
}

/// Whether the request comes from a page of this server, or from no page at all. Browsers let any page
/// open a WebSocket to any host and only say where the page is from (RFC 6455, section 10.2): without
/// this any site that the user visits could pause a mission.
fn is_own_page(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else {
        return true;
    };
    let host = headers.get(header::HOST).and_then(|h| h.to_str().ok());
    let origin = origin.to_str().ok().and_then(|o| o.strip_prefix("http://"));
    host.is_some() && origin == host
}

async fn socket(
    State(shared): State<Shared>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !is_own_page(&headers) {
        return (
            StatusCode::FORBIDDEN,
            "only this server's own page may connect\n",
        )
            .into_response();
    }
    upgrade
        .max_message_size(LONGEST_COMMAND)
        .on_upgrade(move |socket| talk(socket, shared))
}

/// Sends frames and takes commands until the page leaves or the mission's server ends.
async fn talk(mut socket: WebSocket, mut shared: Shared) {
    loop {
        let frame = shared.frame.borrow_and_update().clone();
        if socket
            .send(Message::Text(frame.as_ref().into()))
            .await
            .is_err()
        {
            return;
        }
        loop {
            tokio::select! {
                changed = shared.frame.changed() => match changed {
                    Ok(()) => break,
                    Err(_) => return,
                },
                heard = socket.recv() => match heard {
                    Some(Ok(Message::Text(text))) => {
                        if let Some(command) = PageCommand::parse(&text) {
                            // A full queue means that earlier clicks wait; this one is dropped.
                            let _ = shared.commands.try_send(command);
                        }
                    }
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                    Some(Ok(_)) => {}
                },
            }
        }
    }
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

    #[test]
    fn commands_and_garbage() {
        use PageCommand::*;
        let parse = PageCommand::parse;
        assert_eq!(parse(r#"{"command":"pause"}"#), Some(Pause));
        assert_eq!(parse(r#"{"command":"resume"}"#), Some(Resume));
        assert_eq!(parse(r#"{"command":"home"}"#), Some(Home));
        assert_eq!(
            parse(r#"{"command":"speed","factor":10}"#),
            Some(Speed(10.0))
        );
        let fastest = parse(r#"{"command":"speed","factor":null}"#);
        assert_eq!(fastest, Some(Speed(f64::INFINITY)));
        let control = |wish| {
            Some(Control(
                "3".to_owned(),
                super::Control { wish, sticks: None },
            ))
        };
        assert_eq!(
            parse(r#"{"command":"hand-back","vehicle":"3"}"#),
            control(ControlWish::HandBack)
        );
        assert_eq!(
            parse(r#"{"command":"take-over","vehicle":"3"}"#),
            control(ControlWish::TakeOver)
        );
        for garbage in [
            r#"{"command":"hand-back"}"#,
            r#"{"command":"hand-back","vehicle":"a/b"}"#,
            "",
            "pause",
            r#"{"command":"speed","factor":-1}"#,
            r#"{"command":"speed","factor":"x"}"#,
            r#"{"command":"rm"}"#,
        ] {
            assert_eq!(parse(garbage), None, "{garbage}");
        }
    }
}
