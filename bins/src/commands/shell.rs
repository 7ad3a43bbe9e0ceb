//! `plumage completions` and `plumage man`: what shells and manuals know of the commands.

use crate::Failure;
use anyhow::Context as _;
use clap::Command;
use clap_complete::Shell;
use std::io::Write as _;
use std::path::PathBuf;

/// Arguments of `plumage completions`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage completions bash > ~/.local/share/bash-completion/completions/plumage"
)]
pub struct CompletionsArguments {
    /// Shell to print completions for
    pub shell: Shell,
}

/// Arguments of `plumage man`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage man ~/.local/share/man/man1")]
pub struct ManArguments {
    /// Folder for the manual pages
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Prints the completions of a shell.
///
/// # Errors
/// They cannot be printed.
pub fn completions(arguments: &CompletionsArguments, mut command: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    let name = command.get_name().to_owned();
    clap_complete::generate(arguments.shell, &mut command, name, &mut script);
    // As everything that is printed: whoever takes a part of it only hears nothing of the rest.
    print!("{}", String::from_utf8_lossy(&script));
    Ok(std::io::stdout().flush()?)
}

/// Writes a manual page for each command.
///
/// # Errors
/// The folder cannot be written.
pub fn man(arguments: &ManArguments, command: Command) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let failed = || format!("{}: cannot write the manual pages", folder.display());
    std::fs::create_dir_all(folder).with_context(failed)?;
    clap_mangen::generate_to(command, folder).with_context(failed)?;
    println!(
        "Outputs in {}; read them with: man -l {}",
        folder.display(),
        folder.join("plumage.1").display()
    );
    Ok(())
}
