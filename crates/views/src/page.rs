//! The page: a web server that shows a mission, running or recorded, and takes what is clicked.
//!
//! Everything the page needs comes from this program. It answers only requests that name it by
//! an address or `localhost`, so that a web site cannot reach it under a name of its own (DNS
//! rebinding), and takes commands only from pages that it served itself. Where others than those on this host can
//! reach it, it asks for a token. It holds a bounded number of connections, and none that does not ask for anything.

use crate::ViewError;
use crate::live::LiveState;
use crate::map_data::{self, MapView, SectionView};
use crate::server::{self, Limits};
use crate::site::{MapPoint, SiteMap};
use crate::tiles::Tiles;
use air::geo::Enu;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::extract::{Path as UrlPath, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use futures_core::future::BoxFuture;
use protocol::key::Name;
use protocol::message::Destination;
use serde_json::json;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, broadcast, mpsc, watch};

/// Default address of the page.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8787";
/// Shortest time between two frames.
const FRAME: Duration = Duration::from_millis(200);
/// Frames that a page may be behind before it gets all anew.
const FRAMES_BEHIND: usize = 64;
/// Longest command that is read, bytes.
const LONGEST_COMMAND: usize = 256;
/// Requests that are served at once, and live pages that are open: of the 256 files that some systems let a process
/// open they leave half to the mission's outputs. A browser uses up to six connections for a page.
const CONNECTIONS: usize = 64;
const LIMITS: Limits = Limits {
    connections: CONNECTIONS,
    request_within: Duration::from_secs(10),
    reads_within: Duration::from_secs(10),
    closed_within: None,
};
/// Cookie with the token of a page.
const COOKIE: &str = "plumage-token";
/// Speeds that may be asked for.
const FACTORS: RangeInclusive<f64> = 0.01..=1e4;
/// An asset with its path.
macro_rules! asset {
    ($kind:ident, $file:literal) => {
        (
            concat!("/", $file),
            $kind,
            include_str!(concat!("../assets/", $file)),
        )
    };
}
/// What the page is made of beside itself.
const ASSETS: [(&str, &str, &str); 16] = [
    asset!(CSS, "page.css"),
    asset!(CSS, "chart.css"),
    asset!(SCRIPT, "page.js"),
    asset!(SCRIPT, "map.js"),
    asset!(SCRIPT, "plume.js"),
    asset!(SCRIPT, "section.js"),
    asset!(SCRIPT, "readings.js"),
    asset!(SCRIPT, "team.js"),
    asset!(SCRIPT, "shown.js"),
    asset!(SCRIPT, "scale.js"),
    asset!(SCRIPT, "grid.js"),
    asset!(SCRIPT, "svg.js"),
    asset!(SCRIPT, "chart_axes.js"),
    asset!(SCRIPT, "chart_layers.js"),
    asset!(SCRIPT, "chart.js"),
    asset!(SCRIPT, "chart_pointer.js"),
];
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// A command from the page.
#[derive(Debug, Clone, PartialEq)]
pub enum PageCommand {
    /// Hold the mission.
    Pause,
    /// Let it go on.
    Resume,
    /// Simulated over wall time: 1 is real time, infinite is as fast as the processor allows.
    Speed(f64),
    /// A recording is shown from this mission time on, s.
    Seek(f64),
    /// The vehicle of this id is handed back.
    HandBack(String),
    /// The vehicle of this id is taken over and circles there, where it is.
    TakeOver(String, Destination),
    /// The vehicle of this id is taken over, flies there and circles.
    SendTo(String, Destination),
    /// The vehicle of this id comes home, or all do.
    Home(Option<String>),
}

impl PageCommand {
    /// Reads a command of the page: `{"command":"pause"}`, `{"command":"resume"}` or
    /// `{"command":"speed","factor":10}`, factor null for as fast as possible; `{"command":"seek","time_s":60}` in a
    /// recording; `{"command":"take-over","vehicle":"3"}` to let it circle where it is,
    /// `{"command":"go-to","vehicle":"3","e":120,"n":-40,"alt_amsl_m":700}` in metres of the site's frame,
    /// `{"command":"hand-back","vehicle":"3"}` and `{"command":"home","vehicle":"3"}`, without vehicle for all.
    fn parse(text: &str, live: &LiveState) -> Option<Self> {
        let value: serde_json::Value = serde_json::from_str(text).ok()?;
        let vehicle = || {
            let vehicle = value.get("vehicle")?.as_str()?;
            Name::new(vehicle).ok()?;
            Some(vehicle.to_owned())
        };
        let number = |key: &str| value.get(key)?.as_f64().filter(|v| v.is_finite());
        match value.get("command")?.as_str()? {
            "pause" => Some(Self::Pause),
            "resume" => Some(Self::Resume),
            "speed" => match value.get("factor") {
                None | Some(serde_json::Value::Null) => Some(Self::Speed(f64::INFINITY)),
                Some(_) => {
                    let factor = number("factor")?;
                    FACTORS.contains(&factor).then_some(Self::Speed(factor))
                }
            },
            "seek" => Some(Self::Seek(number("time_s")?)),
            "hand-back" => Some(Self::HandBack(vehicle()?)),
            "take-over" => {
                let vehicle = vehicle()?;
                let here = live.state_of(&vehicle)?;
                let here = Destination {
                    lat_deg: here.lat_deg,
                    lon_deg: here.lon_deg,
                    alt_amsl_m: here.alt_amsl_m,
                };
                Some(Self::TakeOver(vehicle, here))
            }
            "go-to" => {
                let at = live.site().frame.to_geodetic(Enu {
                    east_m: number("e")?,
                    north_m: number("n")?,
                });
                let there = Destination {
                    lat_deg: at.lat_deg,
                    lon_deg: at.lon_deg,
                    alt_amsl_m: number("alt_amsl_m")?,
                };
                Some(Self::SendTo(vehicle()?, there))
            }
            "home" => match value.get("vehicle") {
                None => Some(Self::Home(None)),
                Some(_) => Some(Self::Home(Some(vehicle()?))),
            },
            _ => None,
        }
    }
}

/// What the page may offer.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Offered {
    /// Pause and resume.
    pub pause: bool,
    /// Other speeds.
    pub speed: bool,
    /// Takeover, go-to, hand-back and the way home.
    pub control: bool,
    /// A recording's first and last mission time, s, between which it can be wound.
    pub timeline_s: Option<(f64, f64)>,
}

impl Offered {
    fn json(&self) -> serde_json::Value {
        let timeline = self.timeline_s.map(|(from, to)| [from, to]);
        json!({"pause": self.pause, "speed": self.speed, "control": self.control, "timeline_s": timeline})
    }
}

/// What the page has beside the mission.
#[derive(Debug, Clone, Default)]
pub struct PageOptions {
    /// What it may offer.
    pub offered: Offered,
    /// Raster tiles for the map.
    pub tiles: Option<Tiles>,
    /// The mission's report, once it is written.
    pub report: Option<PathBuf>,
    /// What a request has to show, first as `?token=…` and then as a cookie, for a page that others than those on
    /// this host can reach.
    pub token: Option<String>,
}

/// What the page shows, shared by who fills it and the server that sends it.
#[derive(Clone)]
pub struct Live(Arc<Mutex<LiveState>>);

impl Live {
    /// Shares a state.
    pub fn new(state: LiveState) -> Self {
        Self(Arc::new(Mutex::new(state)))
    }

    /// Locks the state and applies `work` to it.
    pub fn with<T>(&self, work: impl FnOnce(&mut LiveState) -> T) -> T {
        // A panic elsewhere leaves a state that can still be shown.
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[derive(Clone)]
struct Shared {
    live: Live,
    site: Arc<SiteMap>,
    options: Arc<PageOptions>,
    frames: broadcast::Sender<Utf8Bytes>,
    commands: mpsc::Sender<PageCommand>,
    open: watch::Receiver<()>,
    /// Live pages that may still be opened.
    pages: Arc<Semaphore>,
    /// Grids are made one after the other, so that many pages do not hold up the mission.
    grids: Arc<Semaphore>,
}

impl Shared {
    /// Sends to all pages what is new.
    fn send_news(&self) {
        // Sent before the state is let go of: who opens a page meanwhile must not get it twice.
        self.live.with(|live| self.send(live.news()));
    }

    fn send(&self, messages: Vec<String>) {
        for message in messages {
            // No page may be there.
            let _ = self.frames.send(message.into());
        }
    }

    /// All there is, for a page that opens, and what will be new from now on.
    fn join(&self) -> (Vec<String>, broadcast::Receiver<Utf8Bytes>) {
        self.live.with(|live| {
            self.send(live.news());
            (live.whole(), self.frames.subscribe())
        })
    }
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

/// Serves the page on `listener` until the sender of `open` is gone and the last news are sent; what people ask for
/// goes to `commands`.
pub fn serve(
    listener: TcpListener,
    live: Live,
    options: PageOptions,
    commands: mpsc::Sender<PageCommand>,
    open: watch::Receiver<()>,
) -> BoxFuture<'static, ()> {
    let (frames, _) = broadcast::channel(FRAMES_BEHIND);
    let site = live.with(|live| Arc::clone(live.site()));
    let shared = Shared {
        live,
        site,
        options: Arc::new(options),
        frames,
        commands,
        open,
        pages: Arc::new(Semaphore::new(CONNECTIONS)),
        grids: Arc::new(Semaphore::new(1)),
    };
    let mut app = Router::new()
        .route("/", get(page))
        .route("/site.json", get(site_json))
        .route("/plume.json", get(plume))
        .route("/ground.json", get(ground))
        .route("/section.json", get(section))
        .route("/refusal.json", get(refusal))
        .route("/report.html", get(report))
        .route("/tiles/{z}/{x}/{y}", get(tile))
        .route("/live", get(socket));
    for (path, kind, text) in ASSETS {
        app = app.route(path, get(|| async { asset(kind, text) }));
    }
    let app = app
        .layer(middleware::from_fn_with_state(
            shared.clone(),
            only_with_token,
        ))
        .layer(middleware::from_fn(server::only_by_address))
        .with_state(shared.clone());
    // Boxed: compiled here, and not in each program that serves it. A panic in the drawing ends the page as well.
    Box::pin(async move {
        let drawing = tokio::spawn(draw(shared));
        server::serve(listener, app, LIMITS, async { _ = drawing.await }).await;
    })
}

/// Sends what is new, no more often than anybody can see.
async fn draw(shared: Shared) {
    let mut open = shared.open.clone();
    while tokio::time::timeout(FRAME, open.changed()).await.is_err() {
        shared.send_news();
    }
    shared.send_news();
}

fn asset(kind: &'static str, text: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text).into_response()
}

async fn page(State(shared): State<Shared>) -> Response {
    let mut response = asset(
        "text/html; charset=utf-8",
        include_str!("../assets/page.html"),
    );
    let tiles = shared.options.tiles.as_ref();
    // Nothing from elsewhere is loaded but the tiles that somebody asked for, and nobody may frame the page to
    // steal clicks.
    let policy = format!(
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob: {}; frame-ancestors 'none'",
        tiles.map_or("", Tiles::origin)
    );
    if let Ok(policy) = header::HeaderValue::from_str(&policy) {
        let name = header::CONTENT_SECURITY_POLICY;
        response.headers_mut().insert(name, policy);
    }
    response
}

async fn site_json(State(shared): State<Shared>) -> Response {
    let mut site = shared.site.json();
    if let Some(site) = site.as_object_mut() {
        site.insert("offered".to_owned(), shared.options.offered.json());
        let tiles = shared.options.tiles.as_ref();
        site.insert("tiles".to_owned(), json!(tiles.map(Tiles::template)));
        site.insert("tile_zooms".to_owned(), json!(tiles.map(Tiles::zooms)));
    }
    Json(site).into_response()
}

/// A place where somebody wants to send a vehicle.
#[derive(serde::Deserialize)]
struct Wanted {
    vehicle: String,
    e: f64,
    n: f64,
    alt_amsl_m: f64,
}

/// Why the vehicle would not go there, before anybody commands it; null where it may.
async fn refusal(State(shared): State<Shared>, Query(to): Query<Wanted>) -> Response {
    let at = Enu {
        east_m: to.e,
        north_m: to.n,
    };
    let alt_amsl_m = to.alt_amsl_m;
    let why = shared
        .site
        .refuses(&to.vehicle, &MapPoint { at, alt_amsl_m });
    Json(json!({ "why": why })).into_response()
}

async fn report(State(shared): State<Shared>) -> Response {
    let is_there = shared.live.with(|live| live.run.reported);
    let path = shared.options.report.clone().filter(|_| is_there);
    let read = tokio::task::spawn_blocking(move || std::fs::read(path?).ok());
    match read.await.ok().flatten() {
        Some(text) => ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], text).into_response(),
        None => (
            StatusCode::NOT_FOUND,
            "the report is written when the mission is over\n",
        )
            .into_response(),
    }
}

async fn tile(
    State(shared): State<Shared>,
    UrlPath((z, x, y)): UrlPath<(u8, u32, u32)>,
) -> Response {
    let Some(Tiles::File(archive)) = shared.options.tiles.clone() else {
        return (StatusCode::NOT_FOUND, "this page has no tiles\n").into_response();
    };
    let media_type = archive.media_type();
    let read = tokio::task::spawn_blocking(move || archive.tile(z, x, y));
    match read.await.ok().flatten() {
        Some(picture) => {
            let headers = [
                (header::CONTENT_TYPE, media_type),
                (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
                (header::CACHE_CONTROL, "max-age=3600"),
            ];
            (headers, picture).into_response()
        }
        None => (StatusCode::NOT_FOUND, "the file has no such tile\n").into_response(),
    }
}

/// A grid, made beside the server's own work; not found where there is nothing to draw.
async fn grid(
    shared: &Shared,
    make: impl FnOnce() -> Option<serde_json::Value> + Send + 'static,
) -> Response {
    let turn = shared.grids.acquire().await;
    let made = match turn {
        Ok(_) => tokio::task::spawn_blocking(make).await.ok().flatten(),
        Err(_) => None,
    };
    match made {
        Some(grid) => Json(grid).into_response(),
        None => (StatusCode::NOT_FOUND, "this area has no data\n").into_response(),
    }
}

async fn plume(State(shared): State<Shared>, Query(view): Query<MapView>) -> Response {
    let (site, model) = (
        Arc::clone(&shared.site),
        shared.live.with(|live| live.model()),
    );
    grid(&shared, move || {
        map_data::plume(&site, model?.as_ref(), view)
    })
    .await
}

async fn ground(State(shared): State<Shared>, Query(view): Query<MapView>) -> Response {
    let site = Arc::clone(&shared.site);
    grid(&shared, move || map_data::ground(&site, view)).await
}

async fn section(State(shared): State<Shared>, Query(view): Query<SectionView>) -> Response {
    let (site, model) = (
        Arc::clone(&shared.site),
        shared.live.with(|live| live.model()),
    );
    grid(&shared, move || {
        map_data::section(&site, model.as_deref(), view)
    })
    .await
}

/// Refuses requests without the page's token, where it has one: neither as `?token=…`, which sets the cookie, nor as that.
async fn only_with_token(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let Some(token) = &shared.options.token else {
        return next.run(request).await;
    };
    let named = |pairs: &str, between: char, name: &str| {
        pairs.split(between).any(|pair| {
            let pair = pair.trim().split_once('=');
            pair.is_some_and(|(key, value)| key == name && is_same(value, token))
        })
    };
    let asked = request.uri().query().unwrap_or_default();
    let cookies = request.headers().get_all(header::COOKIE);
    let mut cookies = cookies.iter().filter_map(|c| c.to_str().ok());
    if named(asked, '&', "token") {
        let mut response = next.run(request).await;
        let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
        if let Ok(cookie) = header::HeaderValue::from_str(&cookie) {
            response.headers_mut().insert(header::SET_COOKIE, cookie);
        }
        return response;
    }
    if cookies.any(|cookies| named(cookies, ';', COOKIE)) {
        return next.run(request).await;
    }
    (
        StatusCode::UNAUTHORIZED,
        "open this page with its token, as http://ADDRESS/?token=TOKEN\n",
    )
        .into_response()
}

/// Whether two texts are the same, in a time that does not tell where they differ.
fn is_same(a: &str, b: &str) -> bool {
    let differs = a
        .bytes()
        .zip(b.bytes())
        .fold(0, |all, (a, b)| all | (a ^ b));
    a.len() == b.len() && differs == 0
}

/// Whether the request comes from a page of this server. Browsers let any page
/// open a WebSocket to any host and only say where the page is from (RFC 6455, section 10.2): without
/// this any site that the user visits could pause a mission. Who says nothing of it is no page.
fn is_own_page(headers: &HeaderMap) -> bool {
    let host = server::host(headers);
    let origin = headers.get(header::ORIGIN).and_then(|o| o.to_str().ok());
    let origin = origin.and_then(|o| o.strip_prefix("http://"));
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
    let Ok(place) = Arc::clone(&shared.pages).try_acquire_owned() else {
        return (
            StatusCode::SERVICE_UNAVAILABLE,
            "too many pages are open already\n",
        )
            .into_response();
    };
    upgrade
        .max_message_size(LONGEST_COMMAND)
        .on_upgrade(move |socket| async move {
            talk(socket, shared).await;
            drop(place);
        })
}

/// Sends what there is and what is new and takes commands, until the page leaves or the server ends.
async fn talk(mut socket: WebSocket, mut shared: Shared) {
    loop {
        let (whole, mut news) = shared.join();
        for message in whole {
            if socket.send(Message::Text(message.into())).await.is_err() {
                return;
            }
        }
        // A page that falls behind gets the whole again: it holds up neither the mission nor other pages.
        if !follow(&mut socket, &mut shared, &mut news).await {
            return;
        }
    }
}

/// Passes on what is new until the page leaves (false) or has missed some of it (true).
async fn follow(
    socket: &mut WebSocket,
    shared: &mut Shared,
    news: &mut broadcast::Receiver<Utf8Bytes>,
) -> bool {
    loop {
        tokio::select! {
            biased;
            next = news.recv() => match next {
                Ok(text) => if socket.send(Message::Text(text)).await.is_err() {
                    return false;
                },
                Err(broadcast::error::RecvError::Lagged(_)) => return true,
                Err(broadcast::error::RecvError::Closed) => return false,
            },
            heard = socket.recv() => match heard {
                Some(Ok(Message::Text(text))) => {
                    let command = shared.live.with(|live| PageCommand::parse(&text, live));
                    if let Some(command) = command {
                        // A full queue means that earlier clicks wait; this one is dropped.
                        let _ = shared.commands.try_send(command);
                    }
                }
                Some(Ok(Message::Close(_)) | Err(_)) | None => return false,
                Some(Ok(_)) => {}
            },
            // The last news were sent before; a moment for them to leave.
            _ = shared.open.changed() => {
                tokio::time::sleep(FRAME).await;
                while let Ok(text) = news.try_recv() {
                    let _ = socket.send(Message::Text(text)).await;
                }
                return false;
            }
        }
    }
}
