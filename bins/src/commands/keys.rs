//! `plumage keys`: keys and certificates for the hosts of a mission.

use crate::Failure;
use crate::host_keys::{ACCESS, CA, CERTIFICATE, HOST, PRIVATE_KEY};
use anyhow::Context as _;
use protocol::bundle::BundleKind;
use protocol::key::Name;
use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;
use std::str::FromStr;
use tasks::mission_key;

/// Every program can be run on the host itself.
const LOOPBACK: [&str; 2] = ["localhost", "127.0.0.1"];

/// Keys of missions.
#[derive(Debug, clap::Subcommand)]
#[command(after_help = EXAMPLE)]
pub enum KeysCommand {
    /// Create certificates and a key for a mission, one folder for each host
    New(NewArguments),
}

/// Example in the help.
const EXAMPLE: &str = "\
Example: a ground station, and one aircraft that flies vehicle 6

  plumage keys new --mission as-pontes --host ground=192.0.2.1=sc,ws,op,watch --host air=192.0.2.2=va/6 --out keys";

/// Arguments of `plumage keys new`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct NewArguments {
    /// Name of the mission, as mission.name in its scenario
    #[arg(long, value_name = "NAME")]
    mission: String,
    /// Host, its addresses and its roles, several of them separated by commas; repeatable. Roles: sc, ws, va/ID, va (any
    /// vehicle), op (commands of the operator), watch (page and recorder) [default: all roles]
    #[arg(long, value_name = "NAME=ADDRESS[=ROLES]", required = true)]
    host: Vec<Host>,
    /// Folder in which each host gets its own folder
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What may run on a host.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Role {
    Sc,
    Ws,
    /// One vehicle, or any.
    Va(Option<Name>),
    Op,
    Watch,
}

impl FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "sc" => Ok(Self::Sc),
            "ws" => Ok(Self::Ws),
            "va" => Ok(Self::Va(None)),
            "op" => Ok(Self::Op),
            "watch" => Ok(Self::Watch),
            other => other
                .strip_prefix("va/")
                .and_then(|id| Name::new(id).ok())
                .map(|id| Self::Va(Some(id)))
                .ok_or_else(|| format!("role '{other}': expected sc, ws, va, va/ID, op or watch")),
        }
    }
}

impl Role {
    /// Topics that are its alone to write, without the mission.
    fn writes(&self) -> Vec<String> {
        let own = |text: &[&str]| text.iter().map(ToString::to_string).collect();
        match self {
            // With the conductor of a mission in lockstep.
            Self::Sc => own(&[
                "sc/main/call",
                "sc/main/alive",
                "sc/main/last/**",
                "sc/main/event",
                "sc/main/observation",
                "sc/main/plan",
                "sc/main/population",
                "va/*/setpoint",
                "clock/main/**",
            ]),
            Self::Ws => own(&["ws/main/**", "sc/main/extension", "clock/main/done/ws/main"]),
            Self::Va(id) => {
                let id = id.as_ref().map_or("*", Name::as_str);
                let topics = [
                    "state",
                    "reading",
                    "mode",
                    "health",
                    "event",
                    "mavlink/*",
                    "alive",
                    "call",
                    "last/**",
                ];
                let of = topics.map(|topic| format!("va/{id}/{topic}"));
                let done = format!("clock/main/done/va/{id}");
                of.into_iter().chain([done]).collect()
            }
            Self::Op => own(&["va/*/control", "va/*/swap", "va/*/destination"]),
            Self::Watch => own(&["clock/recorder/**", "clock/main/done/clock/recorder"]),
        }
    }
}

#[derive(Debug, Clone)]
struct Host {
    name: Name,
    addresses: Vec<String>,
    roles: Vec<Role>,
}

impl FromStr for Host {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.split('=').collect();
        let (name, addresses, roles) = match parts.as_slice() {
            [name, addresses] => (name, addresses, &"sc,ws,va,op,watch"),
            [name, addresses, roles] => (name, addresses, roles),
            _ => return Err("expected NAME=ADDRESS or NAME=ADDRESS=ROLES".to_owned()),
        };
        let addresses: Vec<String> = addresses.split(',').map(ToOwned::to_owned).collect();
        if addresses.iter().any(String::is_empty) {
            return Err(format!(
                "host {name}: expected an address, such as 192.0.2.1"
            ));
        }
        Ok(Self {
            name: Name::new(name).map_err(|e| e.to_string())?,
            addresses,
            roles: roles.split(',').map(str::parse).collect::<Result<_, _>>()?,
        })
    }
}

/// Runs the command.
///
/// # Errors
/// Wrong usage, or folders that cannot be written.
pub fn keys(command: &KeysCommand) -> Result<(), Failure> {
    match command {
        KeysCommand::New(arguments) => make(arguments),
    }
}

fn make(arguments: &NewArguments) -> Result<(), Failure> {
    let mission = Name::new(&arguments.mission).map_err(Failure::input)?;
    let hosts = &arguments.host;
    for (k, host) in hosts.iter().enumerate() {
        if hosts[..k].iter().any(|other| other.name == host.name) {
            let name = &host.name;
            return Err(Failure::usage(format!(
                "--host {name}: given twice; expected each host once"
            )));
        }
        let folder = arguments.out.join(host.name.as_str());
        if folder.exists() {
            let folder = folder.display();
            return Err(Failure::usage(format!(
                "{folder} exists already; expected another --out, since all hosts get new keys"
            )));
        }
    }
    let (ca, issuer) = authority(&mission).context("cannot make the authority's certificate")?;
    let key = mission_key::new_text().map_err(Failure::input)?;
    let access = access(&mission, hosts).to_string();
    for host in hosts {
        let folder = arguments.out.join(host.name.as_str());
        let (certificate, private_key) =
            certificate(host, &issuer).context("cannot make a host's certificate")?;
        fs::create_dir_all(&folder)?;
        let private = |file: &str, text: &str| mission_key::write_private(&folder.join(file), text);
        private(CA, &ca.pem())?;
        private(CERTIFICATE, &certificate.pem())?;
        private(PRIVATE_KEY, &private_key.serialize_pem())?;
        private(mission_key::FILE, &key)?;
        private(ACCESS, &access)?;
        private(HOST, host.name.as_str())?;
        println!("{}: for {}", folder.display(), host.addresses.join(", "));
    }
    println!(
        "Copy each folder to its host over a secure channel, and start every program there with --keys."
    );
    Ok(())
}

/// A new authority, the key of which is forgotten once all hosts have their certificates.
fn authority(mission: &Name) -> Result<(Certificate, Issuer<'static, KeyPair>), rcgen::Error> {
    let mut wanted = CertificateParams::default();
    wanted.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    wanted.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let name = format!("plumage {mission}");
    wanted.distinguished_name.push(DnType::CommonName, name);
    let key = KeyPair::generate()?;
    let certificate = wanted.self_signed(&key)?;
    Ok((certificate, Issuer::new(wanted, key)))
}

/// The certificate of a host, by which it listens as well as connects.
fn certificate(
    host: &Host,
    issuer: &Issuer<'_, KeyPair>,
) -> Result<(Certificate, KeyPair), rcgen::Error> {
    let named = host.addresses.iter().map(String::as_str).chain(LOOPBACK);
    let mut wanted = CertificateParams::new(named.map(ToOwned::to_owned).collect::<Vec<_>>())?;
    wanted.use_authority_key_identifier_extension = true;
    wanted.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    wanted.extended_key_usages = vec![
        ExtendedKeyUsagePurpose::ServerAuth,
        ExtendedKeyUsagePurpose::ClientAuth,
    ];
    let name = host.name.as_str();
    wanted.distinguished_name.push(DnType::CommonName, name);
    let key = KeyPair::generate()?;
    Ok((wanted.signed_by(&key, issuer)?, key))
}

/// Zenoh's access control: everybody with a certificate may listen and ask; what a host says is taken from it where
/// its roles write.
fn access(mission: &Name, hosts: &[Host]) -> Value {
    let whole = |topic: &String| format!("plumage/{mission}/{topic}");
    let everything = [whole(&"**".to_owned())];
    let names: Vec<&str> = hosts.iter().map(|host| host.name.as_str()).collect();
    let mut rules = vec![
        json!({
            "id": "listens", "permission": "allow", "flows": ["ingress", "egress"],
            "messages": ["declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"],
            "key_exprs": &everything,
        }),
        json!({
            "id": "receives", "permission": "allow", "flows": ["egress"],
            "messages": ["put", "delete", "reply", "declare_queryable", "liveliness_token"],
            "key_exprs": &everything,
        }),
    ];
    // What processes ask each other to find each other again; answers hold by the mission's key alone. Who is there and
    // what was last said stands under the agents who say so, and is theirs alone.
    let asked = [whole(&"peer/**".to_owned())];
    rules.push(json!({
        "id": "answers", "permission": "allow", "flows": ["ingress"],
        "messages": ["reply", "declare_queryable", "liveliness_token"],
        "key_exprs": &asked,
    }));
    let mut subjects = vec![json!({"id": "hosts", "cert_common_names": names})];
    let mut policies =
        vec![json!({"rules": ["listens", "receives", "answers"], "subjects": ["hosts"]})];
    for host in hosts {
        let name = host.name.as_str();
        // Receivers check the messages in its bundles.
        let bundles = BundleKind::ALL.map(|kind| kind.key(mission, &host.name));
        let writes = host.roles.iter().flat_map(Role::writes).map(|t| whole(&t));
        let writes: Vec<String> = writes.chain(bundles).collect();
        let rule = net::publish_rule(&host.name);
        rules.push(json!({
            "id": rule, "permission": "allow", "flows": ["ingress"],
            "messages": ["put", "reply", "declare_queryable", "liveliness_token"],
            "key_exprs": writes,
        }));
        subjects.push(json!({"id": name, "cert_common_names": [name]}));
        policies.push(json!({"rules": [rule], "subjects": [name]}));
    }
    json!({
        "enabled": true, "default_permission": "deny",
        "rules": rules, "subjects": subjects, "policies": policies,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_are_read_and_refused_in_words() {
        let host: Host = "air=192.0.2.2,air.local=va/6,watch".parse().unwrap();
        assert_eq!(host.addresses, ["192.0.2.2", "air.local"]);
        let six = Name::new("6").unwrap();
        assert_eq!(host.roles, [Role::Va(Some(six)), Role::Watch]);
        let all: Host = "ground=192.0.2.1".parse().unwrap();
        assert_eq!(all.roles.len(), 5);
        for (wrong, says) in [
            ("air", "NAME=ADDRESS"),
            ("air==va", "address"),
            ("air=192.0.2.2=pilot", "role 'pilot'"),
            ("a/b=192.0.2.2", "name 'a/b'"),
        ] {
            let said = wrong.parse::<Host>().unwrap_err();
            assert!(said.contains(says), "{wrong}: {said}");
        }
    }

    /// Who writes a topic by the protocol can write it by access control, and no other role can.
    #[test]
    fn roles_write_what_the_protocol_has_them_write() {
        use protocol::{AgentId, Topic};
        let id = Name::new("6").unwrap();
        let roles = [
            (Role::Sc, AgentId::sc()),
            (Role::Ws, AgentId::ws()),
            (Role::Va(Some(id.clone())), AgentId::va("6").unwrap()),
            (Role::Op, AgentId::operator()),
        ];
        let covers = |role: &Role, path: &str| {
            let matches = |rule: String| match rule.strip_suffix("/**") {
                Some(start) => path.starts_with(start),
                None => {
                    let (rule, path) = (rule.split('/'), path.split('/'));
                    rule.clone().count() == path.clone().count()
                        && rule
                            .zip(path)
                            .all(|(rule, part)| rule == "*" || rule == part)
                }
            };
            role.writes().into_iter().any(matches)
        };
        // Nobody answers for another when the roll is called, or where a mission stands in another's name.
        for (role, agent) in &roles {
            for (_, other) in &roles {
                for path in [
                    format!("{other}/call"),
                    format!("{other}/alive"),
                    format!("{other}/last/sc/main/plan"),
                ] {
                    let own = agent == other && *agent != AgentId::operator();
                    assert_eq!(covers(role, &path), own, "{role:?} on {path}");
                }
            }
        }
        for topic in [
            Topic::State(id.clone()),
            Topic::Reading(id.clone()),
            Topic::Mode(id.clone()),
            Topic::MavlinkTx(id.clone()),
            Topic::Setpoint(id.clone()),
            Topic::Control(id.clone()),
            Topic::Swap(id.clone()),
            Topic::Destination(id.clone()),
            Topic::Ambient(id),
            Topic::Plan,
            Topic::Extension,
            Topic::Model,
            Topic::Event(AgentId::ws()),
        ] {
            for (role, agent) in &roles {
                assert_eq!(
                    covers(role, &topic.path()),
                    topic.writer() == *agent,
                    "{role:?} on {}",
                    topic.path()
                );
            }
        }
    }
}
