// @ts-check
/** The 3-D view: drawn when something has changed, never in a loop. */
import {
  AxesHelper, Box3, BufferGeometry, Float32BufferAttribute, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  PerspectiveCamera, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "/vendor/three/OrbitControls.js";
import { Figure, Shapes } from "./bodies.js";
import { POSTURES, cloud } from "./workspace_cloud.js";
import { get } from "./dom.js";
import { Ghosts } from "./ghosts.js";
import { Gizmo } from "./gizmo.js";
import { Pointing } from "./ghost_pointing.js";
import { printing } from "./printing.js";
import { Floor, glass, light } from "./scenery.js";
import { Slice } from "./reach_slice.js";

const EYES = { space: [1.25, -1.5, 0.85], front: [2.1, 0, 0.12], side: [0, -2.1, 0.12], top: [0, -0.001, 2.3] };

const RED = 0xd62728; // what hits something

// Points of the picture for one of the window's. Edges are smooth because there are more of them, at rest; the
// browser's own smoothing would cost as much in every picture of a moving arm.
const FINE = Math.max(devicePixelRatio, 2);
const COARSE = 1;
const HANDLE = 0.85; // of the picture: where the handle's arrows are whole
const SLOW = 50; // [ms] between two pictures of something that moves
const REST = 300; // [ms] without a new picture until it is drawn finely
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // drawing without a graphics card

export class View {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import("./types.js").Arm} arm
   */
  constructor(canvas, arm) {
    this.canvas = canvas;
    this.arm = arm;
    this.renderer = new WebGLRenderer({ canvas, antialias: false, alpha: true, stencil: true });
    this.renderer.setPixelRatio(COARSE);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(36, 1, arm.reach / 100, arm.reach * 30);
    this.camera.up.set(0, 0, 1);
    this.waiting = false;
    this.last = 0; // [ms] when it was drawn
    this.late = 0; // pictures in a row that came late
    this.slow = this.software(); // what moves is drawn coarsely
    this.coarse = true;
    canvas.dataset.coarse = "true";
    this.resting = 0;
    /** @type {Line | null} */
    this.way = null;
    /** @type {import("three").Points | null} */
    this.cloud = null;
    this.slice = new Slice(this);
    this.shapes = new Shapes(arm);
    this.tube = new MeshLambertMaterial();
    this.drum = new MeshLambertMaterial();
    this.wrong = new MeshLambertMaterial({ color: RED });
    this.place = new Mesh(new SphereGeometry(0.02 * arm.reach, 20, 14), new MeshBasicMaterial({ color: RED }));
    this.place.visible = false; // of a program's first hit
    this.solid = new Figure(this.shapes, this.tube, this.drum);
    this.ghosts = new Ghosts(this.shapes);
    this.scene.add(this.solid.group, this.ghosts.group, this.place);
    if (arm.obstacles?.length) this.scene.add(glass(arm.obstacles));
    light(this.scene);
    this.floor = new Floor(arm, this.shapes, this.scene);
    const length = 0.14 * arm.reach;
    this.base = new AxesHelper(length);
    this.base.matrixAutoUpdate = false;
    this.base.matrix.fromArray(arm.base.flat()).transpose();
    this.tool = new AxesHelper(length);
    for (const axes of [this.base, this.tool]) axes.setColors(0xd62728, 0x2ca02c, 0x1f4fd6).matrixAutoUpdate = false;
    this.scene.add(this.base, this.tool);
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.addEventListener("change", () => this.draw());
    this.gizmo = new Gizmo(this);
    this.pointing = new Pointing(this);
    /** Joint values of the solid arm. */
    this.q = arm.joints.map((joint) => joint.home);
    this.middle = new Vector3();
    this.covered = 0; // share of the picture that buttons cover, from its top
    this.inside = false; // whether the whole arm was in the picture when it last rested
    this.theme();
    new ResizeObserver(() => this.size()).observe(canvas);
    printing(this);
  }

  /** Whether the processor draws. */
  software() {
    const gl = this.renderer.getContext();
    const name = String(gl.getParameter(gl.RENDERER));
    const more = /webkit/i.test(name) && gl.getExtension("WEBGL_debug_renderer_info"); // Firefox complains of it in its console
    return SOFTWARE.test(more ? String(gl.getParameter(more.UNMASKED_RENDERER_WEBGL)) : name);
  }

  /** Take the colours of the page's theme. */
  theme() {
    const dark = document.documentElement.dataset.theme === "dark";
    this.tube.color.set(dark ? 0xc6d0da : 0xdfe4e9);
    this.drum.color.set(dark ? 0x4d9de0 : 0x0072b2);
    this.floor.colour(dark ? 0x4a5663 : 0xb4bec8);
    this.ghosts.paper.set(dark ? 0x1d232a : 0xf3f5f7);
    this.ghosts.show(this.ghosts.wanted);
    this.draw();
  }

  /**
   * Look from one of the standard sides, or fit what is seen in from the side that one looks from.
   * @param {string} name
   */
  look(name) {
    const [x, y, z] = /** @type {Object<string, number[]>} */ (EYES)[name]
      ?? this.camera.position.clone().sub(this.orbit.target).setLength(2.1).toArray();
    const box = this.box();
    for (const one of [...this.ghosts.bodies.flat(), this.cloud, this.slice.cubes]) if (one?.visible) box.expandByObject(one);
    const size = Math.max(0.9 * this.arm.reach, 0.8 * box.getSize(this.middle).length());
    box.getCenter(this.middle);
    this.orbit.target.copy(this.middle);
    this.camera.position.set(x, y, z).multiplyScalar(size).add(this.middle);
    this.orbit.update();
    this.inside = false; // until it is looked at
    this.draw();
  }

  /** What has to be seen: the arm, and its handle. */
  box() {
    this.scene.updateMatrixWorld();
    const box = new Box3().setFromObject(this.solid.group);
    if (this.gizmo.there) box.union(new Box3().setFromCenterAndSize(this.gizmo.handle.position, new Vector3().setScalar(0.3 * this.arm.reach)));
    return box;
  }

  /** Fit the arm in when it has just left the picture; who looks closer on purpose is left alone. */
  keep() {
    const frames = this.solid.tool ? [...this.solid.at, this.solid.tool] : this.solid.at;
    const points = frames.map((T) => new Vector3(T[3], T[7], T[11]));
    const inside = (/** @type {Vector3} */ point, /** @type {number} */ most) => {
      const at = point.project(this.camera);
      return Math.max(Math.abs(at.x), Math.abs((at.y + this.covered) / (1 - this.covered))) < most;
    };
    const seen = points.every((point) => inside(point, 1)) && (!this.gizmo.there || inside(this.gizmo.handle.position.clone(), HANDLE));
    if (this.inside && !seen && !this.gizmo.dragging) this.look("fit");
    else this.inside = seen;
  }

  /** @param {number[]} q @param {number[]} [red] bodies that hit something */
  pose(q, red = []) {
    this.q = q;
    this.solid.pose(q);
    this.solid.paint(red, this.wrong);
    this.canvas.dataset.red = red.join(" "); // for tests
    this.floor.shadow.pose(q);
    if (this.solid.tool) this.tool.matrix.fromArray(this.solid.tool).transpose();
    this.tool.matrixWorldNeedsUpdate = true;
    this.draw();
  }

  /** Show ghosts instead of those shown. @param {import("./ghosts.js").Ghost[]} wanted */
  showGhosts(wanted) {
    this.ghosts.show(wanted);
    this.pointing.show(wanted, this.q);
    this.canvas.dataset.solid = String(wanted.filter((ghost) => ghost.solid).length); // for tests
    this.draw();
  }

  /** Show where the tip gets to, or show it no more. */
  reach() {
    if (!this.cloud) {
      this.cloud = cloud(this.arm); // made when it is asked for first
      this.cloud.visible = false;
      this.scene.add(this.cloud);
    }
    this.cloud.visible = !this.cloud.visible;
    get("reach").setAttribute("aria-pressed", String(this.cloud.visible));
    this.legend();
    this.draw();
  }

  legend() {
    const apart = this.arm.obstacles?.length ? ", obstacles apart" : "";
    const reach = this.cloud?.visible ? `; points: the tip in ${POSTURES} poses spread within the limits${apart}` : "";
    get("legend").textContent = `a square is ${this.floor.step} mm${reach}${this.slice.words}`;
  }

  /** Draw the tip's way through a program. @param {number[][]} tips @param {number[]} [hit] where it hits something */
  trail(tips, hit) {
    this.place.visible = hit !== undefined;
    if (hit) this.place.position.set(hit[0], hit[1], hit[2]);
    this.canvas.dataset.hit = hit?.join(" ") ?? ""; // for tests
    if (this.way) {
      this.scene.remove(this.way);
      this.way.geometry.dispose();
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(tips.flat(), 3));
    this.way = new Line(geometry, new LineBasicMaterial({ color: 0xd55e00 }));
    this.way.frustumCulled = false;
    this.scene.add(this.way);
    this.draw();
  }

  size() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    // The picture's middle is that of what the buttons at its top leave free.
    const bar = Math.max(get("views").getBoundingClientRect().bottom - this.canvas.getBoundingClientRect().top, 0);
    this.covered = Math.min(bar / clientHeight, 0.5);
    const height = clientHeight * (1 - this.covered);
    // A narrow window sees as much to its sides as a square one.
    const aspect = clientWidth / height;
    this.camera.fov = (360 / Math.PI) * Math.atan(Math.tan(Math.PI / 10) / Math.min(aspect, 1));
    this.camera.setViewOffset(clientWidth, height, 0, height - clientHeight, clientWidth, clientHeight);
    this.now();
  }

  /** Where drawing is slow, as without a graphics card, draw coarsely what moves, and finely what rests. */
  pace() {
    const now = performance.now();
    const gap = now - this.last;
    this.last = now;
    this.late = gap < 400 && gap > SLOW ? this.late + 1 : 0;
    if (this.late >= 3) this.slow = true;
    if (this.slow) this.fine(false);
    clearTimeout(this.resting);
    if (this.coarse) this.resting = setTimeout(() => this.rest(), REST);
  }

  /** Nothing moves any more. */
  rest() {
    this.keep();
    this.fine(true);
    this.renderer.render(this.scene, this.camera);
  }

  /** @param {boolean} yes */
  fine(yes) {
    if (this.coarse === !yes) return;
    this.coarse = !yes;
    this.renderer.setPixelRatio(yes ? FINE : COARSE);
    this.canvas.dataset.coarse = String(!yes);
  }

  /** Draw at the next opportunity. */
  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.now());
  }

  now() {
    this.waiting = false;
    this.pace();
    this.renderer.render(this.scene, this.camera);
    this.pointing.labels();
    const at = this.gizmo.handle.getWorldPosition(new Vector3()).project(this.camera);
    const { width, height } = this.canvas.getBoundingClientRect();
    // For tests and other programs that drag the handle: where it is in the picture [px].
    this.canvas.dataset.handle = `${((at.x + 1) / 2) * width} ${((1 - at.y) / 2) * height}`;
  }
}
