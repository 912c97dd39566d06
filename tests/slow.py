"""Tests that `scripts/check quick` leaves out: above a second of a core, or waiting in real time.

The gate runs all. Measured with `pytest --durations=100`; a name in the right-hand column is a test function, and
without one the whole file is slow.
"""

from __future__ import annotations

SLOW: dict[str, tuple[str, ...]] = {
    "attacks/test_signals.py": (),
    "attacks/test_bounds.py": (
        "test_copies_of_a_branch_are_counted_before_they_are_made",
        "test_long_words_take_no_long_time",
        "test_standard_input_without_end_is_refused",
    ),
    "board/test_board_sim.py": ("test_mutated_frames_move_nothing_that_was_not_sent",),
    "board/test_cutting.py": (
        "test_a_line_is_exact_coordinated_and_within_every_bound",
        "test_a_short_ramp_pays_for_no_long_cruise",
        "test_speed_changes_no_faster_than_the_acceleration",
    ),
    "board/test_feetech_machine.py": ("test_random_moves_arrive_and_stay_near_their_line",),
    "board/test_grbl_machine.py": ("test_200_random_moves_are_read_back_exact",),
    "board/test_machine.py": ("test_a_noisy_line_ends_at_exact_counts",),
    "board/test_resuming.py": ("test_a_motion_that_was_held_goes_on_and_ends_where_it_should",),
    "calibration/test_calibration.py": (),
    "cli/test_cli_batch.py": (
        "test_memory_does_not_grow_with_the_rows",
        "test_pulses_cost_at_most_four_times_what_fk_costs",
    ),
    "cli/test_cli_process.py": (),
    "cli/test_cli_workspace_plot.py": (
        "test_workspace_for_people",
        "test_workspace_json_is_the_survey",
        "test_workspace_usage",
    ),
    "cli/test_home.py": (),
    "cli/test_new_words.py": (
        "test_teach_refuses_a_port_that_is_none",
        "test_teach_says_how_it_ends",
    ),
    "cli/test_robots_command.py": ("test_what_a_robot_can_do_is_what_the_commands_do",),
    "cli/test_send_in_real_time.py": (
        "test_a_changed_file_means_a_lost_position",
        "test_a_cut_line",
        "test_a_killed_sender",
        "test_a_noisy_line",
        "test_a_signal_stops_the_arm_first",
        "test_lost_then_assumed_then_known",
        "test_rows_that_trickle_in",
        "test_stop_beside_a_suspended_sender",
        "test_stop_from_another_terminal",
        "test_stop_without_a_sender",
    ),
    "compiled/test_compiled.py": (),
    "export/test_c.py": (),
    "fuzz/test_fuzz_command_lines.py": (),
    "fuzz/test_fuzz_devices.py": (),
    "fuzz/test_fuzz_robot_files.py": (),
    "inverse/test_edges.py": (),
    "inverse/test_elimination.py": (),
    "inverse/test_every_branch.py": (),
    "inverse/test_near.py": (),
    "inverse/test_regular.py": ("test_all_at_once_is_as_one_by_one",),
    "inverse/test_truth.py": (),
    "motion/test_every_way.py": (),
    "motion/test_singular_paths.py": (),
    "plot/test_plot.py": (),
    "reach/test_workspace.py": (
        "test_memory_does_not_grow_with_the_samples",
        "test_volume_is_repeatable",
        "test_volume_is_the_known_one_within_its_own_error",
        "test_volume_of_an_arm_with_a_wrist",
    ),
    "teach/test_teach_board.py": (),
    "teach/test_teach_browser.py": (),
    "teach/test_teach_flow.py": (),
    "teach/test_teach_guard.py": ("test_a_thousand_connections_do_not_keep_the_page_out",),
    "teach/test_teach_safety.py": (),
    "test_lowest_versions.py": (),
    "test_package.py": (),
    "test_readme.py": ("test_commands_print_what_the_readme_shows",),
}
