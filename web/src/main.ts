import { mount } from "svelte";
import App from "./app/App.svelte";
import "./theme.css";
import "./controls.css";

mount(App, { target: document.getElementById("app") as HTMLElement });
