//! Joining a [run](crate::runs): one process keeps its time and lets the others in. Who asks shows the mission's key and says who he
//! is and what he flies; the answer is made for his question alone, so that nobody else can tell the time, and holds
//! the number of the run, with which all that is said is sealed.

use crate::locks::lock;
use crate::run::{Run, RunJoined, is_of_team};
use crate::{Net, NetError, random};
use futures_core::future::BoxFuture;
use protocol::AgentId;
use protocol::digest::hex;
use protocol::joining::{Answer, BUS_VERSION, Introduction, Question, Refused, time_key};
use protocol::seal::MissionKey;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use zenoh::query::{ConsolidationMode, QueryTarget};

/// How long who was let in may take to show itself, and how long who is cut off is shown: Zenoh's lease of 10 s and
/// some.
pub(crate) const LEASE: Duration = Duration::from_secs(12);
/// Time between two questions.
const AGAIN: Duration = Duration::from_millis(100);
/// How long who wants to keep the time looks whether somebody does: a connection on a busy host.
const LOOK: Duration = Duration::from_secs(1);
/// How long who keeps the time, and is there, may take to answer until a person is told.
const PATIENCE: Duration = Duration::from_secs(5);
/// Length of a question, bytes: nobody meets one twice.
const QUESTION_BYTES: usize = 16;

/// How far the door is open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Opening {
    /// Nobody is answered: the keeper looks whether a run flies already.
    Closed,
    /// The first agent of the team begins a run.
    Offered,
    /// The run has begun: whoever belongs to it is let in.
    Begun,
}

/// Where the keeper of a run's time lets others in, for as long as its session is open.
pub(crate) struct Door {
    key: MissionKey,
    introduction: Option<Introduction>,
    admitted: Mutex<BTreeMap<String, (u64, Instant)>>,
    presence: crate::Presence,
    joined: RunJoined,
    opening: Mutex<Opening>,
}

impl Door {
    /// Why who asks is not let in.
    fn refuses(&self, question: &Question) -> Option<Refused> {
        let refused = |passes, why| Some(Refused { why, passes });
        // Who speaks for the operator alone has no introduction, and keys of every version.
        let version = question
            .wire_version
            .filter(|_| question.introduction.is_some());
        if let Some(theirs) = version.filter(|v| *v != BUS_VERSION) {
            let why = format!(
                "it uses wire version {theirs}, this mission uses {BUS_VERSION}; update the older program"
            );
            return refused(false, why);
        }
        let own_run = self.joined.run().map(|run| run.number);
        if question.hears.iter().any(|run| Some(*run) != own_run) {
            return refused(true, "another run of this mission is active".to_owned());
        }
        let asks = question.introduction.as_ref()?;
        let own = self.introduction.as_ref()?;
        if let Some(difference) = own.mission.difference(&asks.mission)
            && !asks.agents.is_empty()
        {
            let why = format!(
                "it was started with {difference}; expected the scenario, seed and options of the other processes"
            );
            return refused(false, why);
        }
        let present = self.presence.everybody();
        let mut admitted = lock(&self.admitted);
        for agent in &asks.agents {
            let other = admitted.get(agent).filter(|(stream, since)| {
                *stream != question.stream && (present.contains(agent) || since.elapsed() < LEASE)
            });
            let stranger =
                !admitted.contains_key(agent) && !question.announced && present.contains(agent);
            if other.is_some() || stranger || own.agents.contains(agent) {
                return refused(true, format!("{agent} is on the bus already"));
            }
        }
        for agent in &asks.agents {
            admitted.insert(agent.clone(), (question.stream, Instant::now()));
        }
        None
    }

    /// Words for who keeps the time to tell a person of who only looks.
    fn differs(&self, question: &Question) -> Option<String> {
        let (own, asks) = (self.introduction.as_ref()?, question.introduction.as_ref()?);
        own.mission.difference(&asks.mission)
    }

    /// Whether who asks is let in, and in which run; none where nobody is answered yet.
    fn answers(&self, question: &Question) -> Option<(Run, Option<Refused>)> {
        let mut opening = lock(&self.opening);
        let mut agents = question.introduction.iter().flat_map(|i| &i.agents);
        let of_team = agents.any(|agent| is_of_team(agent));
        if *opening == Opening::Closed || (*opening == Opening::Offered && !of_team) {
            return None;
        }
        let refused = self.refuses(question);
        if *opening == Opening::Offered {
            if refused.is_some() {
                return Some((Run::begin().ok()?, refused));
            }
            self.joined.join(Run::begin().ok()?);
            *opening = Opening::Begun;
        }
        Some((self.joined.run()?, refused))
    }

    /// From now on the first agent of the team begins a run.
    pub(crate) fn offer(&self) {
        let mut opening = lock(&self.opening);
        if *opening == Opening::Closed {
            *opening = Opening::Offered;
        }
    }

    /// Lets others into `run`, unless another has begun.
    pub(crate) fn begin(&self, run: Run) {
        let mut opening = lock(&self.opening);
        if *opening != Opening::Begun {
            self.joined.join(run);
            *opening = Opening::Begun;
        }
    }

    /// The run that has begun.
    pub(crate) fn begun(&self) -> Option<Run> {
        let opening = lock(&self.opening);
        (*opening == Opening::Begun).then(|| self.joined.run())?
    }
}

/// Makes a door, closed still, through which others come in for as long as `net` is open.
///
/// # Errors
/// [`NetError::Refused`] where somebody keeps the mission's time already.
pub(crate) async fn door(net: &Net) -> Result<Arc<Door>, NetError> {
    let own = net.own_agents();
    if net.connects {
        // Whom it is connected to shows itself at once, and for a while after it was cut off.
        let begun = Instant::now();
        let mut seen = false;
        while begun.elapsed() < if seen { LEASE } else { LOOK } {
            let present = net.presence().everybody();
            seen = own.iter().any(|agent| present.contains(agent));
            tokio::time::sleep(AGAIN).await;
        }
        if seen {
            return Err(NetError::Refused(format!(
                "{} is on the bus already",
                own.join(", ")
            )));
        }
    }
    let door = Arc::new(Door {
        key: net.key.clone(),
        introduction: net.introduction.clone(),
        admitted: Mutex::default(),
        presence: net.presence(),
        joined: net.joined(),
        opening: Mutex::new(Opening::Closed),
    });
    let sealer = net.sealer();
    let key = time_key(&net.mission);
    let (answer_key, of_door) = (key.clone(), Arc::clone(&door));
    let reply = move |query: &zenoh::query::Query| {
        let door = &of_door;
        let payload = query
            .payload()
            .map(|p| p.to_bytes().to_vec())
            .unwrap_or_default();
        let code = query.attachment().map(|a| a.to_bytes().to_vec());
        let question = Question::read(&door.key, &payload, &code.unwrap_or_default());
        let Some(question) = question else { return };
        let Some((run, refused)) = door.answers(&question) else {
            return;
        };
        let (stream, number) = lock(&sealer).so_far();
        let answer = Answer {
            now_ns: run.age_ns(),
            run: run.number,
            stream,
            number,
            refused,
        };
        if let (Some(words), None) = (door.differs(&question), &answer.refused) {
            eprintln!("warning: a watching process was started with {words}");
        }
        let (answer, code) = answer.coded(&door.key, &question.question);
        // Who asked has gone if the answer does not arrive; it will ask again.
        let _ = zenoh::Wait::wait(query.reply(answer_key.clone(), answer).attachment(code));
    };
    net.asking().reply(key, reply).await?;
    Ok(door)
}

/// What the keeper of the mission's time answered.
pub(crate) struct Admission {
    /// The mission's time when it answered, ns.
    pub(crate) now_ns: i64,
    /// When it was asked, and how long its answer took to come.
    pub(crate) asked: Instant,
    pub(crate) way: Duration,
}

impl Admission {
    /// The run numbered so.
    pub(crate) fn run(&self, number: u64) -> Run {
        let half = self.asked + self.way / 2;
        let age = Duration::from_nanos(self.now_ns.max(0).unsigned_abs());
        Run {
            number,
            start: half.checked_sub(age).unwrap_or(half),
        }
    }
}

/// Asks the keeper of the mission's time to be let in, until it answers.
///
/// # Errors
/// [`NetError::Refused`] with its words.
pub(crate) fn ask(net: &Net) -> BoxFuture<'_, Result<Admission, NetError>> {
    Box::pin(async move {
        let begun = Instant::now();
        loop {
            let (admission, answer) = ask_once(net).await?;
            match answer.refused {
                None => {
                    net.set_run(admission.run(answer.run), (answer.stream, answer.number));
                    return Ok(admission);
                }
                Some(refused) if refused.passes && begun.elapsed() < LEASE => {}
                Some(refused) => return Err(NetError::Refused(refused.why)),
            }
            tokio::time::sleep(AGAIN).await;
        }
    })
}

async fn ask_once(net: &Net) -> Result<(Admission, Answer), NetError> {
    let (begun, mut told) = (Instant::now(), false);
    let keepers = [AgentId::sc(), AgentId::clock()].map(|id| id.to_string());
    let (stream, _) = lock(&net.sealer()).so_far();
    loop {
        let number: [u8; QUESTION_BYTES] = random()?;
        let question = Question {
            question: hex(&number),
            wire_version: Some(BUS_VERSION),
            stream,
            announced: net.has_announced(),
            hears: net.presence().runs().iter().map(|r| r.run.number).collect(),
            introduction: net.introduction.clone(),
        };
        let (payload, code) = question.coded(&net.key);
        let asked = Instant::now();
        // Strangers may answer as well, and first: theirs do not hold.
        let replies = net
            .session
            .get(time_key(&net.mission))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .payload(payload)
            .attachment(code)
            .await
            .map_err(NetError::zenoh)?;
        while let Ok(reply) = replies.recv_async().await {
            let way = asked.elapsed();
            let Ok(sample) = reply.result() else { continue };
            let bytes = sample.payload().to_bytes();
            let code = sample.attachment().map(|a| a.to_bytes().to_vec());
            let code = code.unwrap_or_default();
            if let Some(answer) = Answer::read(&net.key, &question.question, &bytes, &code) {
                let admission = Admission {
                    now_ns: answer.now_ns,
                    asked,
                    way,
                };
                return Ok((admission, answer));
            }
        }
        let present = net.peers();
        let there = keepers.iter().find(|keeper| present.contains(*keeper));
        if let Some(keeper) = there.filter(|_| !told && begun.elapsed() > PATIENCE) {
            told = true;
            eprintln!(
                "warning: {keeper} is present but does not answer this process; check that both have the same \
                 mission key (--keys, --mission-key, PLUMAGE_MISSION_KEY), and that both or neither use \
                 --lockstep"
            );
        }
        tokio::time::sleep(AGAIN).await;
    }
}
