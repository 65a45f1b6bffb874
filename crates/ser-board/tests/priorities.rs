//! RTIC takes only literals for priorities. This test checks that both boards use the budget's
//! values and no others.

use std::fs;
use std::path::{Path, PathBuf};

use ser_board::budget::{
    CAPTURE_PRIORITY, EXTERNAL_BUS_PRIORITY, RECEIVE_PRIORITY, TRANSMIT_PRIORITY,
};

/// Interrupt and priority of every task.
type Tasks = Vec<(String, u8)>;

fn sources(board: &str) -> Vec<(PathBuf, String)> {
    let folder =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware").join(board).join("src");
    let files = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    files.map(|file| (file.clone(), fs::read_to_string(file).unwrap())).collect()
}

/// The value of `name = value` in an attribute.
fn argument<'a>(attribute: &'a str, name: &str) -> Option<&'a str> {
    let (_, value) = attribute.split_once(&format!("{name} = "))?;
    value.split([',', ')']).next()
}

fn tasks_in(source: &str) -> Tasks {
    let attributes = source.split("#[task(").skip(1).map(|rest| rest.split(']').next().unwrap());
    let task = |attribute| {
        let (binds, priority) = (argument(attribute, "binds"), argument(attribute, "priority"));
        (binds.unwrap_or("no interrupt").to_owned(), priority.unwrap_or("1").parse().unwrap())
    };
    attributes.map(task).collect()
}

fn assert_tasks_are(board: &str, expected: &[(&str, u8)]) {
    let mut found = Tasks::new();
    for (file, source) in sources(board) {
        found.extend(tasks_in(&source));
        assert!(!source.contains("set_priority"), "{} sets a priority by itself", file.display());
    }
    let expected: Tasks =
        expected.iter().map(|&(interrupt, priority)| (interrupt.to_owned(), priority)).collect();
    assert_eq!(found, expected, "{board}");
}

#[test]
fn tasks_of_the_emulated_board_have_the_budgets_priorities() {
    let receive = ("UART0_RX", RECEIVE_PRIORITY);
    assert_tasks_are(
        "mps2-an385",
        &[("TIMER0", CAPTURE_PRIORITY), receive, ("UART0_TX", TRANSMIT_PRIORITY)],
    );
}

#[test]
fn tasks_of_the_board_to_flash_have_the_budgets_priorities() {
    let geni = ("EXTI9_5", EXTERNAL_BUS_PRIORITY);
    assert_tasks_are(
        "stm32f407",
        &[("TIM3", CAPTURE_PRIORITY), ("USART2", RECEIVE_PRIORITY), geni],
    );
}

#[test]
fn attributes_are_read_as_rtic_reads_them() {
    let source = "#[task(binds = A, priority = 7, local = [x])]\nfn a() {}\n#[task(priority = \
     2)]\n#[task(binds = B)]";
    let tasks: [(String, u8); 3] =
        [("A", 7), ("no interrupt", 2), ("B", 1)].map(|(a, b)| (a.to_owned(), b));
    assert_eq!(tasks_in(source), tasks);
}
