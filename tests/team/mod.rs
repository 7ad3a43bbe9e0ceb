//! The processes of a mission as a test runs them: on this host, or on hosts of their own, which are namespaces.

use libtest_mimic::Failed;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// An empty folder of this test's own.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("faults-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// One process of a mission, with what it said on standard error in a file. It ends with its owner.
pub struct Process {
    /// Its name here, and that of an agent of it on the bus.
    pub name: &'static str,
    child: Child,
    log: PathBuf,
    host: Option<String>,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Process {
    /// Sends it a signal, such as -STOP.
    pub fn signal(&self, signal: &str) {
        let sent = Command::new("kill")
            .args([signal, &self.child.id().to_string()])
            .status()
            .unwrap();
        assert!(sent.success());
    }

    /// What it said on standard error so far.
    pub fn said(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    /// Its end, if it comes before `until`.
    pub fn ends_before(&mut self, until: Instant) -> Result<ExitStatus, Failed> {
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return Ok(status);
            }
            if Instant::now() > until {
                let said = self.said();
                return Err(format!("{} has not ended; it said: {said}", self.name).into());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// A figure that it serves.
    pub fn figure(&self, figure: &str) -> Option<f64> {
        // The last said is of the process that runs: one that is started again says on in the same file.
        let said = self.said();
        let serves = said
            .lines()
            .rev()
            .find_map(|line| line.strip_prefix("metrics: http://127.0.0.1:"));
        let port = serves?.strip_suffix("/metrics")?;
        // By the shell, which reads from within the process's host.
        let read = format!(
            "exec 3<>/dev/tcp/127.0.0.1/{port} && printf 'GET /metrics HTTP/1.0\\r\\n\\r\\n' >&3 && timeout 2 cat <&3"
        );
        let mut shell = on_host(self.host.as_deref(), "bash");
        let read = shell
            .args(["-c", &read])
            .stderr(Stdio::null())
            .output()
            .ok()?;
        let text = String::from_utf8(read.stdout).ok()?;
        let line = text.lines().find(|line| line.starts_with(figure))?;
        line.rsplit(' ').next()?.parse().ok()
    }

    /// Whether it hears an agent.
    pub fn hears(&self, agent: &str) -> bool {
        self.figure(&format!("plumage_present{{agent=\"{agent}\"}}")) == Some(1.0)
    }
}

/// A program on a host, or on this one.
fn on_host(host: Option<&str>, program: &str) -> Command {
    let Some(host) = host else {
        return Command::new(program);
    };
    let mut command = Command::new("ip");
    command.args(["netns", "exec", host, program]);
    command
}

/// A mission in processes.
pub struct Team {
    /// For what they say and leave.
    pub folder: PathBuf,
    /// Where its processes meet.
    pub endpoint: String,
    common: Vec<String>,
    /// Those that were started.
    pub processes: Vec<Process>,
    /// The host of those that are started next, and its address.
    pub host: Option<(String, String)>,
}

impl Team {
    /// A mission whose processes meet at `endpoint`, with options that all get, the scenario among them.
    pub fn meeting_at(name: &str, endpoint: String, common: &[&str]) -> Self {
        Self {
            folder: folder(name),
            endpoint,
            common: common.iter().map(ToString::to_string).collect(),
            processes: Vec::new(),
            host: None,
        }
    }

    /// Starts a process, which is called `name` here and on the bus.
    pub fn start(&mut self, name: &'static str, program: &str, more: &[&str]) {
        let log = self.folder.join(name.replace('/', "-"));
        let mut command = on_host(self.host.as_ref().map(|h| h.0.as_str()), program);
        command.args(more).args(&self.common);
        if name == "sc/main" {
            command.args(["--listen", &self.endpoint]);
        } else {
            command.args(["--connect", &self.endpoint]);
            if let Some((_, address)) = &self.host {
                let (protocol, _) = self.endpoint.split_once('/').unwrap();
                command.args(["--listen", &format!("{protocol}/{address}:0")]);
            }
        }
        let child = command
            .args(["--metrics", "127.0.0.1:0"])
            .stdin(Stdio::null())
            .stdout(std::fs::File::create(log.with_extension("out")).unwrap())
            .stderr(
                std::fs::File::options()
                    .append(true)
                    .create(true)
                    .open(&log)
                    .unwrap(),
            )
            .spawn()
            .unwrap();
        self.processes.retain(|p| p.name != name);
        self.processes.push(Process {
            name,
            child,
            log,
            host: self.host.as_ref().map(|h| h.0.clone()),
        });
    }

    /// The process of that name.
    pub fn of(&mut self, name: &str) -> &mut Process {
        self.processes.iter_mut().find(|p| p.name == name).unwrap()
    }

    /// Waits until something is so, at the longest for `patience`.
    pub fn wait(
        &self,
        what: &str,
        patience: Duration,
        is: impl Fn(&Self) -> bool,
    ) -> Result<(), Failed> {
        let until = Instant::now() + patience;
        while !is(self) {
            if Instant::now() > until {
                let said: Vec<String> = self
                    .processes
                    .iter()
                    .map(|p| format!("{}: {}", p.name, p.said()))
                    .collect();
                return Err(format!("not within {patience:?}: {what}\n{}", said.join("\n")).into());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(())
    }

    /// Whether any two hear each other.
    pub fn all_meet(&self) -> bool {
        let names: Vec<&str> = self.processes.iter().map(|p| p.name).collect();
        self.processes.iter().all(|p| {
            let mut others = names.iter().filter(|name| **name != p.name);
            others.all(|name| p.hears(name))
        })
    }
}

/// Whether a folder holds report, tracks, summary and a recording that can be read.
pub fn outputs_are_whole(folder: &Path) -> Result<(), Failed> {
    for name in ["summary.json", "report.html", "tracks.kml", "scenario.toml"] {
        let length = std::fs::metadata(folder.join(name)).map_or(0, |m| m.len());
        if length < 100 {
            return Err(format!("{}: {name} holds {length} bytes", folder.display()).into());
        }
    }
    let read = Command::new(env!("CARGO_BIN_EXE_plumage"))
        .arg("replay")
        .arg(folder.join("mission.mcap"))
        .output()
        .unwrap();
    if !read.status.success() {
        return Err(String::from_utf8_lossy(&read.stderr).into_owned().into());
    }
    if folder.join(".plumage-reserve").exists() {
        return Err("the space set aside is still there".into());
    }
    Ok(())
}
