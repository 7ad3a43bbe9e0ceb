//! The pure crates stay pure: their dependency trees hold no async runtime and no bus. Rayon's threads are admitted: the
//! number of threads changes no result.

use std::process::Command;

/// The crates that promise it.
const PURE: [&str; 18] = [
    "air",
    "formats",
    "import",
    "infer",
    "plume",
    "fdm",
    "csea",
    "gap",
    "gap-truth",
    "study",
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

fn pure_crates_pull_in_no_runtime() {
    for package in PURE {
        let tree = tree(package);
        for name in ["tokio", "zenoh", "async-std", "mio", "axum"] {
            assert!(!holds(&tree, name), "{package} pulls in {name}:\n{tree}");
        }
    }
}

fn the_check_sees_what_it_looks_for() {
    let net = tree("net");
    assert!(holds(&net, "zenoh") && holds(&net, "tokio") && holds(&net, "mio"));
    assert!(holds(&tree("views"), "axum"));
}

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

/// Tests of a folder are one executable, so that each is a module of its `main.rs`: a file that nobody names
/// there, or an attribute that the programs' own runner does not read, would be a test that never runs.
fn every_file_of_tests_is_run() {
    let named = |folder: &str, exceptions: &[&str]| {
        let main = std::fs::read_to_string(format!("{folder}/main.rs")).unwrap();
        for entry in std::fs::read_dir(folder).unwrap() {
            let file = entry.unwrap().file_name().into_string().unwrap();
            let Some(module) = file.strip_suffix(".rs") else {
                continue;
            };
            let run = main.contains(&format!("mod {module};"));
            assert!(
                run || module == "main" || exceptions.contains(&module),
                "{folder}/{file} is no module of main.rs"
            );
        }
    };
    // The words in two parts: this file is one of those that are read.
    let attributes = [concat!("#[te", "st]"), concat!("#[tokio::te", "st")];
    // Targets of their own.
    named("../tests", &["bus"]);
    for entry in std::fs::read_dir("../crates").unwrap() {
        let folder = entry.unwrap().path();
        if folder.join("tests/main.rs").exists() {
            named(folder.join("tests").to_str().unwrap(), &["measured"]);
        }
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        if manifest.contains("\n[lib]\ntest = false\n") {
            for file in sources(folder.join("src").to_str().unwrap()) {
                let text = std::fs::read_to_string(&file).unwrap();
                assert!(!text.contains(attributes[0]), "{file} has a unit test");
            }
        }
    }
    for file in sources("../tests") {
        let text = std::fs::read_to_string(&file).unwrap();
        for attribute in attributes {
            assert!(
                file.ends_with("bus.rs") || !text.contains(attribute),
                "{file} has {attribute}: list the test in its tests! instead"
            );
        }
    }
}

/// A test is ignored for its length alone; what lacks a tool finds that out when it runs.
fn tests_are_ignored_for_their_length_alone() {
    let ignored = concat!("#[ign", "ore");
    for folder in ["../tests", "../crates", "../bins/src"] {
        for file in sources(folder) {
            let text = std::fs::read_to_string(&file).unwrap();
            for line in text.lines().filter(|line| line.trim().starts_with(ignored)) {
                assert!(line.contains("= \"second tier: "), "{file}: {line}");
            }
        }
    }
}

crate::runner::tests! {
    Cores {
        pure_crates_pull_in_no_runtime,
        the_check_sees_what_it_looks_for,
        pure_crates_use_no_clock_file_socket_or_thread_random,
        every_file_of_tests_is_run,
        tests_are_ignored_for_their_length_alone,
    }
}
