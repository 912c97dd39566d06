// @ts-check
/**
 * What the server sends; lengths in mm, angles in degrees.
 *
 * @typedef {{name: string, unit: string, lower: number|null, upper: number|null, home: number,
 *   prismatic: boolean, ratio: number, at: number, step: number}} Joint
 * @typedef {{open: number, closed: number, unit: string, along: number[]}} Gripper
 * @typedef {{robot: string, robot_file: string, reach: number, base: number[][],
 *   links: number[][][], bodies: number[][][], joints: Joint[], poses: Object<string, number[]>,
 *   motors: {name: string, unit: string}[]|null, no_motors: string, gripper: Gripper|null,
 *   lock: string|null, locks: boolean, obstacles?: number[], jogs?: string[],
 *   meshes?: {unit: number, bodies: string[]}|null}} Arm
 * @typedef {{name: string, joints: number[], within_limits: boolean, outside: string[], hits?: string, motion: number}} Branch
 * @typedef {{pulses: number[], moves: number[], from: string, error_mm: number, best: boolean,
 *   outside_travel: string[]}} Motors
 * @typedef {{q: number[], outside: string[], red?: number[], tip: {position_mm: number[], rpy_deg: number[]},
 *   motors: Motors|null, task: string|null, why?: string, labels?: string[], units?: string[], target?: number[],
 *   status: string|null, complete?: boolean, free?: string[], branches: Branch[], names?: string[],
 *   chosen?: number|null, closest?: {joints: number[], distance_mm: number, angle_deg: number}|null}} Look
 * @typedef {{port: string, board: string, simulated: boolean, connected: boolean, doing: string, follows: boolean, ended: {count: number, name: string}, done_s: number,
 *   total_s: number, position: string, pulses: number[]|null, joints: number[]|null, commanded?: number[]|null, error: string, differences: string[]}} BoardState
 * @typedef {{kind: string, name: string, said: string, blend: number|null}} ProgramMove
 * @typedef {{moves: ProgramMove[], blend: number, speed: number, tool_speed: number|null, via: boolean,
 *   undo: number, redo: number}} ProgramState
 * @typedef {{duration_s: number, approach_s: number, length_mm: number, shown_mm: number, time: number[], joints: number[][], tips: number[][],
 *   shares: number[][], stops: number[], refused?: string, hit?: number[]}} Played
 * @typedef {{size: number, frame: number[][], centres: number[], shares: number[], of: number, held: string|null, values: number}} ReachSlice
 */
export {};
