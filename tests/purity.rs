//! The pure crates stay pure: their dependency trees hold no async runtime and no bus.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::process::Command;

/// The crates that promise it.
const PURE: [&str; 17] = [
    "air",
    "formats",
    "import",
    "infer",
    "plume",
    "fdm",
    "csea",
    "gap",
    "gap-truth",
    "scenario",
    "protocol",
    "ws",
    "va",
    "sc",
    "mav-bridge",
    "stand-in",
    "mission",
];

fn tree(package: &str) -> String {
    // One package at a time, and from the root: features of the programs must not be unified into it.
    let output = Command::new(env!("CARGO"))
        .current_dir("..")
        .args([
            "tree",
            "--offline",
            "--prefix",
            "none",
            "-e",
            "normal",
            "-p",
            package,
        ])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn holds(tree: &str, name: &str) -> bool {
    tree.lines()
        .filter_map(|line| line.split(' ').next())
        .any(|crate_name| crate_name == name || crate_name.starts_with(&format!("{name}-")))
}

#[test]
fn pure_crates_pull_in_no_runtime() {
    for package in PURE {
        let tree = tree(package);
        for name in ["tokio", "zenoh", "async-std", "mio", "axum"] {
            assert!(!holds(&tree, name), "{package} pulls in {name}:\n{tree}");
        }
    }
}

#[test]
fn the_check_sees_what_it_looks_for() {
    let net = tree("net");
    assert!(holds(&net, "zenoh") && holds(&net, "tokio") && holds(&net, "mio"));
    assert!(holds(&tree("views"), "axum"));
}

#[test]
fn pure_crates_use_no_clock_file_socket_or_thread_random() {
    let forbidden = [
        "std::time::Instant",
        "std::time::SystemTime",
        "Instant::now",
        "SystemTime::now",
        "std::fs",
        "std::net",
        "std::env::",
        "rand::rng()",
        "thread_rng",
        "SysRng",
        "HashMap",
        "HashSet",
    ];
    for package in PURE {
        for file in sources(&format!("../crates/{package}/src")) {
            // Behind the feature `link`, which is off unless a program asks for it.
            if file.ends_with("mav-bridge/src/link.rs") {
                continue;
            }
            let text = std::fs::read_to_string(&file).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            for word in forbidden {
                let used = code
                    .lines()
                    .any(|l| !l.trim_start().starts_with("//") && l.contains(word));
                assert!(!used, "{file} uses {word}");
            }
        }
    }
}

fn sources(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path.display().to_string()));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path.display().to_string());
        }
    }
    found
}
